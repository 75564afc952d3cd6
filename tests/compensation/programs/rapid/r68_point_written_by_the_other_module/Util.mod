MODULE Util
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  PROC rTeach()
    p1:=CRobT(\Tool:=tA);
  ENDPROC
ENDMODULE
