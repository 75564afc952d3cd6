MODULE trap
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
CONST robtarget p1:=[[430.329,-70.758,286.244],[0.165128762,0.578980447,0.788755556,0.124011317],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
CONST robtarget p2:=[[384.537,-151.372,229.631],[0.049439342,0.37047402,-0.920572118,0.113365458],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
VAR intnum i1;
PROC main()
CONNECT i1 WITH t1;
ISignalDI di1,1,i1;
MoveJ p1,v500,fine,tA;
MoveJ p2,v500,fine,tB;
ENDPROC
TRAP t1
tA.tframe.trans:=[0,0,130];
tB:=tA;
ENDTRAP
ENDMODULE
