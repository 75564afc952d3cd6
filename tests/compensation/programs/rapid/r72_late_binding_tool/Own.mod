MODULE Own
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[352.594,219.671,284.256],[0.056930472,-0.6246845,0.778023926,0.034741425],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[412.129,14.549,345.625],[0.228267157,-0.161864137,0.949961533,-0.138806314],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p3:=[[-17.811,-147.572,48.022],[0.154884382,-0.409408713,-0.887005246,0.147027301],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    rMove p1,v500,fine,tA;
    MoveGlue p2,v100,fine,tA\WObj:=wA;
    MoveJ p3,v500,fine,tA\WObj:=wA;
  ENDPROC
  PROC rMove(robtarget p,speeddata v,zonedata z,PERS tooldata t)
    MoveJ Offs(p,0,0,50),v,z,t;
    MoveL p,v,z,t;
  ENDPROC
ENDMODULE
