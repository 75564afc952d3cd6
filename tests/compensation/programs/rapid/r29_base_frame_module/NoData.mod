MODULE NoData
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  CONST robtarget p1:=[[22.127,304.032,389.388],[0.272650562,-0.27018213,0.893014232,0.234923113],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[283.585,113.614,256.12],[0.135264428,0.467992068,-0.849364015,0.203144599],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveJ p1,v1000,fine,tG\WObj:=wElse;
    MoveJ p2,v1000,fine,tG;
    MoveJ pElse,v1000,fine,tG;
    MoveJ p2,v1000,fine,tElse;
  ENDPROC
ENDMODULE
