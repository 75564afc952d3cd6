MODULE opti
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
PERS robtarget p1:=[[390.786,216.365,269.945],[0.119007639,-0.106974498,0.987084588,0.007593133],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
PROC main()
MoveJ p1,v500,fine,tA;
Reader\Pos:=p1;
ENDPROC
PROC Reader(\INOUT robtarget Pos)
Pos:=CRobT();
ENDPROC
ENDMODULE
