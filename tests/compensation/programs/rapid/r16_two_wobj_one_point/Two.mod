MODULE Two
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[310,80,60],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[99.459,-14.89,152.466],[0.008544538,-0.463398152,0.875285239,-0.138075681],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[-38.899,103.125,155.378],[0.073232002,0.487409716,-0.863578167,0.106308943],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveJ p1,v1000,fine,tG\WObj:=wA;
    MoveJ p1,v1000,fine,tG\WObj:=wB;
    MoveJ p2,v1000,fine,tG\WObj:=wB;
  ENDPROC
ENDMODULE
