MODULE Conv
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wCnv:=[FALSE,FALSE,"CNV1",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[129.66,-37.451,232.695],[0.270569716,-0.209601945,0.938515598,0.045249588],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[110.374,49.368,253.704],[0.232431272,-0.578351368,0.77325142,-0.116480214],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    ActUnit CNV1;
    WaitWObj wCnv;
    MoveL p1,v500,fine,tA\WObj:=wCnv;
    DropWObj wCnv;
    MoveL p2,v500,fine,tA\WObj:=wA;
  ENDPROC
ENDMODULE
