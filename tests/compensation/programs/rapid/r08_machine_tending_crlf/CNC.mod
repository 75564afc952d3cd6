MODULE CNC
  PERS tooldata tRaw:=[TRUE,[[0,-30,120],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];
  PERS tooldata tDone:=[TRUE,[[0,30,120],[0,0,0,1]],[1,[0,0,50],[1,0,0,0],0,0,0]];
  CONST robtarget pRawApp:=[[382.747,35.732,301.843],[0.094266285,-0.241614245,0.961251474,-0.093445321],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pRaw:=[[382.747,35.732,271.843],[0.094266285,-0.241614245,0.961251474,-0.093445321],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pDoneApp:=[[384.518,-66.539,291.91],[0.036053476,-0.945166156,0.258804949,-0.195910907],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pDone:=[[384.518,-66.539,261.91],[0.036053476,-0.945166156,0.258804949,-0.195910907],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC ChangePart()
    MoveJ pDoneApp, v1500, z10, tDone;
    MoveL pDone, v100, fine, tDone;
    SetDO doGrip2,1;
    WaitDI diGrip2,1\MaxTime:=5;
    MoveL pDoneApp, v500, z10, tDone\WObj:=wobj0;
    MoveJ pRawApp, v1500, z10, tRaw;
    MoveL pRaw, v100, fine, tRaw;
    SetDO doGrip1,0;
    MoveL pRawApp, v500, z10, tRaw;
  ERROR
    IF ERRNO=ERR_WAIT_MAXTIME THEN
      TPWrite "Kein Teil / no part; MoveL p, v1, fine, tool0;";
      RETRY;
    ENDIF
  ENDPROC
ENDMODULE
