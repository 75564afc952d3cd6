MODULE Opt
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[306.999,8.215,234.988],[0.24232989,0.573014323,-0.773984425,0.117808828],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[296.235,11.609,282.688],[0.098167238,0.083110248,-0.991510426,0.019051393],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p3:=[[168.819,-188.993,280.632],[0.324062674,-0.049149449,0.944492959,-0.022377791],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    go \WObj:=wB;
    go;
    MoveJ p3,v500,fine,tA\WObj:=wA;
  ENDPROC
  PROC go(\PERS wobjdata WObj)
    MoveJ p1,v500,fine,tA\WObj?WObj;
    IF Present(WObj) THEN
      MoveL p2,v500,fine,tA\WObj:=WObj;
    ENDIF
  ENDPROC
ENDMODULE
