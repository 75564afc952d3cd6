MODULE Irq
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  CONST robtarget p1:=[[433.462,-47.53,335.69],[0.157750118,0.266971959,0.949754601,0.042509665],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[430.9,-76.267,288.295],[0.015407044,-0.512379966,0.838474409,-0.18490554],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR intnum i1;
  PROC main()
    CONNECT i1 WITH tEsc;
    ISignalDI diEsc,1,i1;
    MoveJ p1,v1000,fine,tG;
  ENDPROC
  TRAP tEsc
    VAR robtarget pHere;
    StopMove;
    StorePath;
    pHere:=CRobT(\Tool:=tG);
    MoveJ p2,v1000,fine,tG;
    MoveL pHere,v1000,fine,tG;
    RestoPath;
    StartMove;
  ENDTRAP
ENDMODULE
