MODULE Cond
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wL:=[FALSE,TRUE,"",[[300,100,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wR:=[FALSE,TRUE,"",[[300,-100,50],[0.965925826,0,0,0.258819045]],[[0,0,0],[1,0,0,0]]];
  CONST jointtarget jSafe:=[[-16.782,15.895,9.536,15.07,52.071,15.195],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pL:=[[97.653,-62.234,154.02],[0.043328862,0.038020781,0.992900711,-0.104044258],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pR:=[[163.16,128.072,372.136],[0.197363459,0.397485799,0.89351304,-0.068462779],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pRdown:=[[163.16,128.072,342.136],[0.197363459,0.397485799,0.89351304,-0.068462779],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveAbsJ jSafe,v1000,z50,tG;
    TEST giProg
    CASE 1,2:
      MoveJ pL,v1000,z50,tG\WObj:=wL;
    CASE 3:
      MoveJ pR,v1000,z50,tG\WObj:=wR;
      MoveL pRdown,v100,fine,tG\WObj:=wR;
    DEFAULT:
      Stop;
    ENDTEST
    IF diStop=1 MoveAbsJ jSafe,v1000,z50,tG;
  ENDPROC
ENDMODULE
