%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Weld
  PERS tooldata tTorch:=[TRUE,[[20,0,180],[0.953716951,0,0.3007058,0]],[2.1,[10,0,90],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wJig:=[FALSE,TRUE,"",[[400,0,200],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS seamdata seam1:=[0.5,0.2,[0,0,0,0,0,0,0,0,0],0,0,0,0,0,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0];
  CONST robtarget pW1:=[[-50.114,113.071,39.053],[0.10713568,0.379066178,-0.917993372,0.046032025],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW2:=[[-30.114,113.071,39.053],[0.10713568,0.379066178,-0.917993372,0.046032025],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW3:=[[-20.114,123.071,39.053],[0.10713568,0.379066178,-0.917993372,0.046032025],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW4:=[[-10.114,143.071,39.053],[0.10713568,0.379066178,-0.917993372,0.046032025],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PROC Seam1()
    MoveJ pW1,v1000,z10,tTorch\WObj:=wJig;
    ArcLStart pW2,v100,seam1,weld1\Weave:=weave1,fine,tTorch\WObj:=wJig;
    ArcC pW3,pW4,v100,seam1,weld1\Weave:=weave1,z1,tTorch\WObj:=wJig;
    MoveC pW3,pW2,v100,fine,tTorch\WObj:=wJig;
  ENDPROC
ENDMODULE
