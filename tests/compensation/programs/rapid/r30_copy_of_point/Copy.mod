MODULE Copy
  PERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[0,0,160],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  CONST robtarget p1:=[[319.313,111.703,256.426],[0.110721637,0.056579249,-0.984355577,-0.124834311],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[318.865,180.968,264.584],[0.041174885,-0.466228316,0.875972925,-0.116649993],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    VAR robtarget pX;
    MoveJ p1,v1000,fine,tA;
    pX:=p1;
    MoveJ pX,v1000,fine,tB;
    pX:=p2;
    MoveJ pX,v1000,fine,tA;
    MoveJ p2,v1000,fine,tB;
  ENDPROC
ENDMODULE
