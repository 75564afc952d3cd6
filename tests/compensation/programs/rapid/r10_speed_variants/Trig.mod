MODULE Trig
  PERS tooldata tGun:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata w1:=[FALSE,TRUE,"",[[300,0,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  VAR triggdata gun;
  VAR robtarget pFound;
  CONST robtarget q1:=[[142.607,-131.432,340.363],[0.263126237,0.262323974,0.91942624,-0.128864681],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget q2:=[[152.607,-131.432,340.363],[0.263126237,0.262323974,0.91942624,-0.128864681],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget q3:=[[162.607,-126.432,340.363],[0.263126237,0.262323974,0.91942624,-0.128864681],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget q4:=[[167.607,-116.432,340.363],[0.263126237,0.262323974,0.91942624,-0.128864681],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC Glue()
    TriggIO gun,10\DOp:=doGlue,1;
    MoveJ q1,[500,100,5000,1000],[FALSE,5,8,8,0.8,8,0.8],tGun\WObj:=w1;
    TriggL q2,v200\T:=2,gun,z1,tGun\WObj:=w1;
    MoveLDO q3,v200,z1,tGun\WObj:=w1,doGlue,0;
    MoveC q3,q4,v200,fine,tGun\WObj:=w1;
    MoveJDO q1,v200,z1,tGun\WObj:=w1,doGlue,0;
    SearchL diSen,pFound,q2,v20,tGun\WObj:=w1;
  ENDPROC
ENDMODULE
