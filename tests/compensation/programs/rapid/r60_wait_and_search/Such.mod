MODULE Such
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  PERS robtarget pFound:=[[446.543,18.245,278.22],[0.139453259,0.339600152,0.920363879,0.134739953],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pEnd:=[[427.858,-182.757,272.076],[0.174414491,0.481307752,0.859008194,0.005230247],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p3:=[[253.839,-296.902,303.077],[0.092787857,0.162046129,-0.969192327,0.16061662],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveJ p3,v500,fine,tA;
    SearchL\Stop,diProbe,pFound,pEnd,v20,tA;
    MoveL pFound,v50,fine,tA;
    MoveL RelTool(pFound,0,0,-20),v50,fine,tA;
  ERROR
    IF ERRNO=ERR_WHLSEARCH THEN
      MoveL p3,v50,fine,tA;
      RETRY;
    ENDIF
  ENDPROC
ENDMODULE
