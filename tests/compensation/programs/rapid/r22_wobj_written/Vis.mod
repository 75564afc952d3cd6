MODULE Vis
  PERS tooldata tG:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wCam:=[FALSE,TRUE,"",[[300,0,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  VAR cameratarget mycamtarget;
  CONST robtarget p1:=[[15.453,2.135,130.78],[0.140338667,-0.231480401,-0.950195353,0.154436632],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[363.498,142.993,315.09],[0.087122806,0.082908673,0.975129804,-0.186165607],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveJ p2,v1000,fine,tG;
    CamReqImage mycamera;
    CamGetResult mycamera,mycamtarget;
    wCam.oframe:=mycamtarget.cframe;
    MoveL p1,v1000,fine,tG\WObj:=wCam;
  ENDPROC
ENDMODULE
