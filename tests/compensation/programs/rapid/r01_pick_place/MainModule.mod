MODULE MainModule
  !Pick and place, cell 12
  PERS tooldata tGripper:=[TRUE,[[0,0,95],[1,0,0,0]],[1.2,[0,0,50],[1,0,0,0],0,0,0]];
  PERS wobjdata wobjConv:=[FALSE,TRUE,"",[[350,-100,120],[0.996194698,0,0,0.087155743]],[[0,0,0],[1,0,0,0]]];
  CONST jointtarget jHome:=[[35.677,8.735,20.904,23.944,49.877,-50.16],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p10:=[[64.234,113.992,163.742],[0.070638984,-0.068660637,-0.993380407,0.059086537],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p20:=[[64.234,113.992,123.742],[0.070638984,-0.068660637,-0.993380407,0.059086537],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p30:=[[42.951,14.201,230.766],[0.05707716,0.210124812,-0.962294828,0.163028908],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p40:=[[42.951,14.201,195.766],[0.05707716,0.210124812,-0.962294828,0.163028908],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveAbsJ jHome\NoEOffs,v1000,fine,tool0;
    WHILE TRUE DO
      MoveJ p10,v1000,z50,tGripper\WObj:=wobjConv;
      MoveL p20,v200,fine,tGripper\WObj:=wobjConv;
      Set doVacuum;
      WaitTime 0.3;
      MoveL p10,v1000,z10,tGripper\WObj:=wobjConv;
      MoveJ p30,v1000,z50,tGripper\WObj:=wobjConv;
      MoveL p40,v200,fine,tGripper\WObj:=wobjConv;
      Reset doVacuum;
      MoveL p30,v1000,z10,tGripper\WObj:=wobjConv;
    ENDWHILE
  ENDPROC
ENDMODULE
