MODULE Module1
    PERS tooldata MyTool:=[TRUE,[[31.793,0,229.639],[0.707106781,0,0.707106781,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
    TASK PERS wobjdata Workobject_1:=[FALSE,TRUE,"",[[250,-100,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST robtarget Target_10:=[[409.6,183.752,526.68],[0.243759006,-0.06579968,0.934751976,0.249981386],[0,0,0,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget Target_20:=[[409.6,233.752,526.68],[0.243759006,-0.06579968,0.934751976,0.249981386],[0,0,0,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget Target_30:=[[429.6,233.752,526.68],[0.243759006,-0.06579968,0.934751976,0.249981386],[0,0,0,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    !***********************************************************
    ! Module:  Module1
    ! Description:
    !   <Insert description here>
    !***********************************************************
    PROC main()
        Path_10;
    ENDPROC
    PROC Path_10()
        MoveL Target_10,v1000,z100,MyTool\WObj:=Workobject_1;
        MoveL Target_20,v1000,z100,MyTool\WObj:=Workobject_1;
        MoveL Target_30,v1000,z100,MyTool\WObj:=Workobject_1;
        !MoveL Target_20,v1000,z100,MyTool\WObj:=Workobject_1;
    ENDPROC
ENDMODULE
