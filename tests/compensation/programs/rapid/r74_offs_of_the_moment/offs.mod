MODULE offs
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
CONST robtarget p1:=[[257.375,23.29,146.835],[0.294280894,0.638295308,-0.711028789,0.02039405],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
PROC main()
MoveJ p1,v500,fine,tA;
WHILE di1=0 DO MoveL Offs(CRobT(\Tool:=tA\WObj:=wobj0),0,0,1),v5,fine,tA; ENDWHILE
MoveL Offs (p1,0,0,10),v5,fine,tA;
MoveL offs(p1, 0, 0, 10) , v5,fine,tA;
ENDPROC
ENDMODULE
