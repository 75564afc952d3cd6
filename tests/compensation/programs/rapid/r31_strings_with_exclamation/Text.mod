MODULE Text
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[198.996,-1.821,239.658],[0.19601147,0.363697708,0.877493403,0.243534],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[26.727,-424.654,195.467],[0.007834863,-0.061075567,0.97841214,-0.197276645],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]; ! CONST robtarget p3:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    TPWrite "Achtung! Tür auf"; MoveJ p1,v500,fine,tA\WObj:=wA;
    ! MoveJ p1,v500,fine,tB\WObj:=wB;
    TPErase;MoveL p2,v100,fine,tA\WObj:=wA;TPWrite "MoveL p1,v1,fine,tB;";
  ENDPROC
ENDMODULE
