MODULE Off
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  CONST robtarget p1:=[[443.673,28.274,349.378],[0.111190977,-0.543168188,0.826580383,-0.096797505],[0,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[341.359,-267.495,325.647],[0.13479931,0.309000699,0.924922487,-0.175687525],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR robtarget p3;
  PROC main()
    MoveJ Offs(p1,0,0,100),v1000,fine,tG;
    MoveL p1,v1000,fine,tG;
    MoveL RelTool(p1,0,0,-50\Rz:=30),v1000,fine,tG;
    p3:=Offs(p2,10,0,0);
    MoveL p3,v1000,fine,tG;
    MoveJ p2,v1000,fine,tG;
    MoveC Offs(p1,10,0,0),Offs(p1,10,10,0),v100,fine,tG;
  ENDPROC
ENDMODULE
