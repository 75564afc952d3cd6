MODULE Func
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[265.316,-121.009,171.782],[0.106696796,0.08444125,-0.985178051,-0.104449397],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PERS robtarget p2:=[[319.597,-228.827,393.992],[0.181858345,0.436328684,0.878525652,-0.068829499],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p3:=[[369.726,-75.352,240.185],[0.032164614,0.651438305,0.746730874,0.130332553],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PERS jointtarget j1:=[[-16.615,22.985,9.464,8.704,63.079,-55.844],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR jointtarget j2:=[[2.254,8.59,6.178,24.164,40.938,17.577],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC main()
    MoveJ p1,v500,fine,tA;
    MoveJ shifted(p1,10),v500,fine,tA;
    teach p2;
    MoveJ p2,v500,fine,tA;
    MoveJ p3,v500,fine,tA;
    MoveAbsJ j1,v500,fine,tA;
    j2:=CJointT();
    j2.robax.rax_1:=0;
    MoveAbsJ j2,v500,fine,tA;
    MoveAbsJ CalcJointT(p3,tB),v500,fine,tA;
  ENDPROC
  FUNC robtarget shifted(robtarget p,num dz)
    p.trans.z:=p.trans.z+dz;
    RETURN p;
  ENDFUNC
  PROC teach(INOUT robtarget p)
    p:=CRobT(\Tool:=tA);
  ENDPROC
ENDMODULE
