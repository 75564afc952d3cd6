MODULE Calls
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  CONST robtarget p1:=[[232.617,194.218,200.455],[0.120593721,0.19289417,-0.971537017,0.066066776],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[290.244,-239.522,299.76],[0.067475479,-0.072050864,-0.994576399,0.032764591],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR string proc_name;
  PROC main()
    %"Prog"+ValToStr(1)%;
    Prog2;
  ENDPROC
  PROC Prog1()
    MoveJ p1,v1000,fine,tG;
  ENDPROC
  PROC Prog2()
    MoveJ p2,v1000,fine,tG;
    MoveAbsJ [[-35.051,12.8,7.367,-20.091,71.928,-46.617],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tG;
  ENDPROC
ENDMODULE
