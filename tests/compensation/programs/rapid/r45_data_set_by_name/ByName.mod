MODULE ByName
  PERS tooldata tA:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS tooldata tB:=[TRUE,[[40,0,150],[0.965925826,0.258819045,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wA:=[FALSE,TRUE,"",[[300,100,100],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wB:=[FALSE,TRUE,"",[[300,-100,100],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];
  PERS robtarget p1:=[[389.842,-143.681,361.39],[0.095575223,-0.128161731,0.979747991,-0.120556301],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget p2:=[[417.361,190.354,233.706],[0.059588799,0.2615263,0.951781708,0.148878305],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR robtarget pNew;
  PROC main()
    pNew:=CRobT(\Tool:=tA);
    SetDataVal "p"+ValToStr(1),pNew;
    MoveJ p1,v500,fine,tA;
    MoveJ p2,v500,fine,tA;
  ENDPROC
ENDMODULE
