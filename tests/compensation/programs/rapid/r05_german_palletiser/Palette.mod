MODULE Palette
  ! Palettierer, Lage 1 bis 4. Angelegt 12.03.2009
  TASK PERS tooldata tSauger:=[TRUE,[[0,0,140],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata woPalette:=[FALSE,TRUE,"",[[300,150,60],[0.984807753,0,0,-0.173648178]],[[0,0,0],[1,0,0,0]]];
  LOCAL CONST robtarget pAblage:=[[85.905,-300.886,76.532],[0.070063976,-0.274855375,-0.958479107,0.029383049],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pVorAblage:=[[85.905,-300.886,126.532],[0.070063976,-0.274855375,-0.958479107,0.029383049],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  LOCAL CONST robtarget pWarten:=[[7.557,-41.017,119.28],[0.039330408,0.476472357,-0.876517982,0.056066381],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR num nLage:=0;
  PROC rAblegen()
    nLage:=nLage+1;
    MoveJ pWarten,vmax,z100,tSauger\WObj:=woPalette;
    MoveJ pVorAblage,v1000,z50,tSauger\WObj:=woPalette;
    MoveL Offs(pAblage,0,0,25*nLage),v300,fine,tSauger\WObj:=woPalette;
    MoveL pAblage,v300,fine,tSauger\WObj:=woPalette;
    IF nLage=4 THEN
      nLage:=0;
    ENDIF
  ENDPROC
ENDMODULE
