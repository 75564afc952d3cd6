"""What a program says for certain is corrected; everything else stays byte for byte, and both are listed by line."""

import re

import numpy as np
import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.common.files import data_folder
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from planner.kinematics.robot_reader import load_robot
from tests.command import edbb
from tests.compensation.robots import bent, exact, flange_pose, regular_angles
from tests.compensation.test_cartesian import TOOL, abc_of, frame_text, kuka_status, pose_text
from tests.compensation.test_formats import krl, without_head

NULL = ["$TOOL=$NULLFRAME", "$BASE=$NULLFRAME"]
FREE = ToolAndBase(np.eye(4), np.eye(4))
GOOD_RAPID = "MoveAbsJ [[10,20,10,20,40,30],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;"
GOOD = "PTP {A1 10,A2 -80,A3 100,A4 20,A5 40,A6 30}"


def pose(robot, q_deg=(10, -80, 100, 20, 40, 30), status=True, plus=0):
    q = np.radians(q_deg)
    numbers = ",".join(f"{k} {v:.5f}" for k, v in zip("XYZABC", abc_of(flange_pose(exact(robot), q)), strict=True))
    turn = int((q < 0) @ (1 << np.arange(6)))
    return f"{{{numbers},S {kuka_status(robot, q) + plus},T {turn}}}" if status else f"{{{numbers}}}"


def target(robot, q_deg=(10, 20, 10, 20, 40, 30), external="9E9"):
    q = np.radians(q_deg)
    conf = [int(np.floor(q[j] / (np.pi / 2))) for j in (0, 3, 5)]
    axes = ",".join([external, *["9E9"] * 5])
    return f"{pose_text(flange_pose(exact(robot), q))[:-1]},[{conf[0]},{conf[1]},{conf[2]},0],[{axes}]]"


def run(path, text, robot, **more):
    path.write_text(text)
    return compensate_file(path, *robot, **more)


def changed(done, text):
    """Lines, counted in the input, that the output has otherwise; everything else must be the same."""
    before, after = text.splitlines(), without_head(done.text).splitlines()
    assert len(before) == len(after)
    return [k for k, (a, b) in enumerate(zip(before, after, strict=True), start=1) if a != b]


def reasons(done):
    return {line: why for line, why in done.report.kept}


LEFT_KRL = {
    "tool component": (["$TOOL.Z=5", "PTP {P}"], 6, r"\$TOOL\.Z is changed in line 5"),
    "base component": (
        ["BASE_DATA[1]={B}", "BAS(#BASE,1)", "BASE_DATA[1].X=3", "PTP {P}"],
        8,
        r"BASE_DATA\[1\]\.X is changed in line 7",
    ),
    "two bases": (["BASE_DATA[1]={B}", "BASE_DATA[1]={T}", "BAS(#BASE,1)", "PTP {P}"], 8, r"BASE_DATA\[1\] is changed"),
    "tool on the floor": (["$IPO_MODE=#TCP", "PTP {P}"], 6, r"\$IPO_MODE is #TCP since line 5"),
    "accuracy model": (["PTP {A}"], 5, "accuracy model of its own"),
    "external axis": (["PTP {E}"], 5, "external axes are not at zero"),
    "computed": (["XP1={P}", "XP1.Z=XP1.Z+5", "PTP XP1"], 5, r"XP1 is computed while the program runs \(line 6\)"),
    "made a base": (["XP1={P}", "$BASE=XP1", "PTP XP1"], 5, r"XP1 makes a tool or a base \(line 6\)"),
    "two values": (["F1={F}", "LIN F1", "F1={G}", "LIN F1"], 5, "F1 has more than one value"),
    "relative": (["LIN_REL {Z 5}"], 5, "moves relative"),
    "jump": (["again:", "PTP {P}"], 6, "does not say the tool and base"),
    "tool of one move": (["SPTP {P} WITH $TOOL={B}"], 5, "is no part of a move that is known"),
    "two moves": (["PTP {P} PTP {P}"], 5, "is no part of a move that is known"),
    "second pass": (["LOOP", "PTP {P}", "$TOOL={T}", "ENDLOOP"], 6, "does not say the tool of|the tool and base"),
    "after a branch": (["IF TRUE THEN", "$TOOL={T}", "ENDIF", "PTP {P}"], 8, "does not say the tool"),
    "branch after a loop": (
        ["LOOP", "X()", "ENDLOOP", "$TOOL=$NULLFRAME", "IF TRUE THEN", "$TOOL={T}", "ENDIF", "PTP {P}"],
        12,
        "does not say the tool",
    ),
    "function in a condition": (["IF F(1)==2 THEN", "ENDIF", "PTP {P}"], 7, "does not say the tool and base"),
    "function waited for": (["WAIT FOR F()", "PTP {P}"], 6, "does not say the tool and base"),
    "trigger": (["TRIGGER WHEN DISTANCE=0 DELAY=0 DO $BASE.X=5", "PTP {P}"], 6, "line 5 sets it"),
    "valued after its use": (
        ["BAS(#BASE,1)", "PTP {P}", "BASE_DATA[1]={B}"],
        6,
        r"BASE_DATA\[1\] has its value only after",
    ),
    "valued in a branch": (
        ["IF $IN[1] THEN", "BASE_DATA[1]={B}", "ENDIF", "$BASE=BASE_DATA[1]", "PTP {P}"],
        9,
        r"BASE_DATA\[1\] has its value only after line 6, where that is run",
    ),
    "valued in another routine": (
        ["BAS(#TOOL,2)", "PTP {P}", "END", "DEF NEVER ( )", "TOOL_DATA[2]={T}"],
        6,
        r"TOOL_DATA\[2\] has its value only after line 9",
    ),
    "not of the language": (["TECHNOLOGY USE 5", "PTP {P}"], 6, "what line 5 does is not known: 'TECHNOLOGY USE 5'"),
    "taught with what is not certain": (
        ["DECL FDAT FP1={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}", "XP1={P}", "$TOOL=FIND():$NULLFRAME", "PTP XP1"],
        6,
        "TOOL is changed in line 7",
    ),
    "data of another point": (["FDAT_ACT=FP9", "BAS(#PTP_PARAMS,50)", "PTP {P}"], 7, "taught with are not certain"),
    "data that change": (
        ["DECL FDAT FP1={TOOL_NO 0,BASE_NO 0}", "FP1=FP2", "FDAT_ACT=FP1", "BAS(#CP_PARAMS,1)", "PTP {P}"],
        9,
        "taught with are not certain",
    ),
    "said at its spline": (
        ["XP1={P}", "SPTP XP1 WITH $TOOL=STOOL2(FP7), $BASE=SBASE(FP7.BASE_NO), $IPO_MODE=SIPO_MODE(FP7.IPO_FRAME)"],
        5,
        "taught with are not certain",
    ),
    "external axis of before": (["PTP {E1 300}", "PTP {P}"], 6, "E1 is not said here and keeps its last value"),
    "orientation kept": (["$ORI_TYPE=#CONSTANT", "LIN {P}"], 6, "ORI_TYPE may be #CONSTANT since line 5"),
    "orientation kept by its data": (
        ["LCPDAT1={VEL 2.0,ORI_TYP #CONSTANT}", "LDAT_ACT=LCPDAT1", "BAS(#CP_DAT)", "LIN {P}"],
        8,
        "ORI_TYP is #CONSTANT in line 5",
    ),
    "half a configuration": (["PTP {H}"], 5, "S without T, or T without S"),
    "set on the way": (
        ["XP1={P}", "TRIGGER WHEN DISTANCE=1 DELAY=0 DO XP1.Z=700.0", "PTP XP1"],
        5,
        "XP1 is set in line 6",
    ),
    "configuration set": (["XP1={P}", "XP1.S=6", "PTP XP1"], 5, r"XP1 is computed while the program runs \(line 6\)"),
    "operator by its name": (["XP1={P}", "B_SHIFT(XP1)", "PTP XP1"], 5, "is handed to a routine that may change it"),
    "taught, then changed": (
        [
            "TOOL_DATA[1]={B}",
            "BASE_DATA[1]={B}",
            "DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}",
            "XP1={P}",
            "FDAT_ACT.TOOL_NO=2",
            "BAS(#PTP_PARAMS,100)",
            "PTP XP1",
        ],
        8,
        "taught with are not certain",
    ),
    "trigger of another": (["TRIGGER WHEN PATH=0 DELAY=0 DO SETX() PRIO=-1", "PTP {P}"], 6, "SETX of line 5 may set"),
    "handed over": (["F={B}", "OK=CHG(F)", "$TOOL=F", "$BASE=$NULLFRAME", "PTP {P}"], 9, "F may be changed in line 6"),
    "row": (["B[1]={B}", "B[I].X=5", "$BASE=B[1]", "PTP {P}"], 8, r"B\[1\] may be changed in line 6"),
    "function as a place": (["$OUT[F(2)]=TRUE", "PTP {P}"], 6, "does not say the tool and base"),
    "function beside a move": (["SLIN {P} WITH $VEL.CP=F(2)"], 5, "does not say the tool and base"),
    "stationary tool, in one branch": (
        ["IF TRUE THEN", "$IPO_MODE=#TCP", "ELSE", "$IPO_MODE=#BASE", "ENDIF", "PTP {P}"],
        10,
        r"\$IPO_MODE is #TCP",
    ),
    "stationary tool, by inline form": (
        ["FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #TCP}", "BAS(#FRAMES)", *NULL, "PTP {P}"],
        9,
        "may be #TCP since line 5",
    ),
    "made a base, two steps": (["XP1={P}", "NB=INV_POS(XP1)", "$BASE=NB", "PTP XP1"], 5, r"XP1 makes a tool or a base"),
    "no room to say": (["PTP XHOME"], 5, "XHOME is declared elsewhere"),
}


@pytest.mark.parametrize("name", LEFT_KRL)
def test_krl_lines_that_are_not_certain_are_left_and_named(name, kuka, tmp_path):
    rows, line, why = LEFT_KRL[name]
    robot, _ = kuka
    words = {
        "{P}": pose(robot), "{A}": pose(robot, plus=16), "{E}": pose(robot).replace("}", ",E1 500.0}"),
        "{F}": pose(robot, status=False), "{G}": pose(robot, (20, -80, 100, 20, 40, 30), status=False),
        "{B}": frame_text(np.zeros(6)), "{T}": frame_text(TOOL), "{H}": re.sub(r",T \d+", "", pose(robot)),
    }  # fmt: skip
    for word, value in words.items():
        rows = [row.replace(word, value) for row in rows]
    text = krl(*NULL, GOOD, *rows, GOOD.replace("10", "15"))
    done = run(tmp_path / "p.src", text, kuka)
    assert re.search(why, reasons(done)[line])
    assert changed(done, text) == [4, 5 + len(rows)] == list(done.report.corrected)
    with pytest.raises(InputError, match=why):
        compensate_file(tmp_path / "p.src", *kuka, strict=True)


@pytest.mark.parametrize(
    "rows",
    [
        ["BASE_DATA[1]={B}", "IF $IN[1] THEN", "BAS(#BASE,1)", "PTP {P}", "ENDIF"],
        ["DECL FRAME F", "F={B}", "X()", "$TOOL=$NULLFRAME", "$BASE=F", "PTP {P}"],
    ],
)
def test_krl_frames_hold_where_they_have_certainly_got_their_value(rows, kuka, tmp_path):
    words = {"{P}": pose(kuka[0]), "{B}": frame_text(np.zeros(6)), "{T}": frame_text(TOOL)}
    for word, value in words.items():
        rows = [row.replace(word, value) for row in rows]
    assert run(tmp_path / "p.src", krl(*NULL, *rows), kuka).report.poses == 1


@pytest.mark.parametrize(
    ("beside", "routine", "state"),
    [("ISR", "$TOOL.Z=3", "left"), ("ISR", "HALT", "certain"), ("PARO", "HALT", "unknown"), ("A10", "HALT", "certain")],
)
def test_routines_of_interrupts(kuka, tmp_path, beside, routine, state):
    rows = [f"INTERRUPT WITH BRAKE DECL 9 WHEN $IN[1]==TRUE DO {beside} ( )", f"PTP {pose(kuka[0])}", GOOD, "END"]
    text = krl(*NULL, *rows, "DEF ISR ( )", routine)
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == ([5, 6] if state == "certain" else [6])
    assert ("PARO, which is not in the file" in done.summary) == (state == "unknown")


@pytest.mark.parametrize(
    ("head", "call", "why"),
    [
        ("DEF HALT2 (X:IN)", "HALT2 (1)", None),
        ("GLOBAL DEFFCT INT HALT2 ( )", "HALT2 ( )", None),
        ("DEF A_ROUTINE_OF_MORE_THAN_24_SIGNS ( )", "A_ROUTINE_OF_MORE_THAN_24_SIGNS ( )", None),
        ("DEF HALT2 (X:IN,Y:OUT)", "HALT2 (1,$BASE)", "the routine HALT2"),
        ("DEF OTHER ( )", "HALT2 ( )", "the routine HALT2, which is not in the file"),
    ],
)
def test_routines_that_take_arguments_are_in_the_file(kuka, tmp_path, head, call, why):
    rows = [f"INTERRUPT DECL 9 WHEN $IN[1]==TRUE DO {call}", f"PTP {pose(kuka[0])}", GOOD, "END"]
    text = krl(*NULL, *rows, head, "HALT")
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == ([5, 6] if why is None else [6])
    if why is not None:
        assert f"({why})" in reasons(done)[5]


def test_rapid_points_that_make_a_work_object_in_two_steps(abb, tmp_path):
    """A fake point would move the work object."""
    rows = [
        f"CONST robtarget p1:={target(abb[0])};",
        'PERS wobjdata wB:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
        "VAR pose f;",
        "PROC main()",
        " MoveL p1,v100,fine,tool0;",
        " MoveAbsJ [[10,20,10,20,40,30],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;",
        " f:=DefFrame(p1,p1,p1);",
        " wB.uframe:=f;",
        "ENDPROC",
    ]
    text = "\n".join(["MODULE M", *rows, "ENDMODULE", ""])
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [7]
    assert "p1 makes a tool or a work object" in reasons(done)[2]


@pytest.mark.parametrize("use", ["pickB pA{2};", "pickB pA;", "w.oframe:=DefFrame(pA{1},pA{2},pA{2});"])
def test_rapid_rows_of_points_are_doubted_whole(use, abb, tmp_path):
    rows = f"CONST robtarget pA{{2}}:=[{target(abb[0])},{target(abb[0], (5, 10, 20, 30, 40, 50))}];"
    frame = 'PERS wobjdata w:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
    moves = "MoveL pA{1},v9,fine,tool0;\nMoveL pA{2},v9,fine,tool0;\n" + GOOD_RAPID
    text = f"MODULE M\n{rows}\n{frame}\nPROC main()\n{moves}\n{use}\nENDPROC\nENDMODULE\n"
    assert changed(run(tmp_path / "p.mod", text, abb), text) == [7]


def test_a_rapid_row_of_names_and_numbers_is_left(abb, tmp_path):
    """Its elements are not counted by the rows of numbers."""
    other = target(abb[0], (5, 10, 20, 30, 40, 50))
    rows = f"CONST robtarget p0:={target(abb[0])};\nCONST robtarget pA{{2}}:=[p0,{other}];"
    moves = f"MoveL pA{{1}},v9,fine,tool0;\n{GOOD_RAPID}"
    text = f"MODULE M\n{rows}\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n"
    assert changed(run(tmp_path / "p.mod", text, abb), text) == [6]


def test_krl_points_handed_to_functions_are_left(kuka, tmp_path):
    rows = [f"XP1={pose(kuka[0])}", "OK=ADJ(XP1)", *NULL, "PTP XP1", f"XP2={pose(kuka[0])}", "OK=READS(XP2)", *NULL]
    text = krl(GOOD, *rows, "PTP XP2", "END", "DEFFCT BOOL READS(Q:IN)", "RETURN TRUE", "ENDFCT")
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == [2]
    assert "XP1 is handed to a routine that may change it (line 4)" in reasons(done)[3]


def test_a_stationary_tool_is_not_known_in_another_routine(kuka, tmp_path):
    rows = ["$IPO_MODE=#TCP", "GLUE()", "END", "DEF GLUE()", *NULL, f"PTP {pose(kuka[0])}", "$IPO_MODE=#BASE"]
    text = krl(GOOD, *rows, f"PTP {pose(kuka[0])}")
    assert changed(run(tmp_path / "p.src", text, kuka), text) == [2, 11]


def test_a_parameter_is_not_the_frame_of_its_name(kuka, tmp_path):
    (tmp_path / "p.dat").write_text("DEFDAT P\nDECL FRAME GRIP={X 0,Y 0,Z 100,A 0,B 0,C 0}\nENDDAT\n")
    rows = ["$TOOL=GRIP", "$BASE=$NULLFRAME", f"PTP {pose(kuka[0])}"]
    text = krl(GOOD, *rows, "END", "DEF TO(GRIP:IN)", *rows, "END", "DEF OTHER()", "DECL FRAME GRIP", *rows)
    assert changed(run(tmp_path / "p.src", text, kuka), text) == [2, 5]


def test_what_is_set_in_a_loop_holds_until_it_ends(kuka, tmp_path):
    text = krl("LOOP", *NULL, f"PTP {pose(kuka[0])}", "X()", "ENDLOOP", f"PTP {pose(kuka[0])}")
    assert changed(run(tmp_path / "p.src", text, kuka), text) == [5]


def test_an_accuracy_model_that_is_off_is_no_obstacle(kuka, tmp_path):
    text = krl(*NULL, f"PTP {pose(kuka[0], plus=16)}")
    done = run(tmp_path / "p.src", text, kuka, frames=ToolAndBase(uncorrected=True))
    assert changed(done, text) == [4]
    status = kuka_status(kuka[0], np.radians([10, -80, 100, 20, 40, 30]))
    assert re.search(r"S (\d+)", done.text)[1] == str(status + 16)


def test_frames_given_a_value_in_the_file_are_points_of_their_moves(kuka, tmp_path):
    """F1={X …} then LIN F1: the shape of the arm is the one that it comes in."""
    robot, _ = kuka
    text = krl(*NULL, GOOD, f"F1={pose(robot, (12, -78, 98, 22, 42, 33), status=False)}", "LIN F1")
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == [4, 5]
    assert done.report.left_m < 2e-6
    assert not done.partly


def test_statements_go_on_over_lines_and_comments(kuka, tmp_path):
    robot, _ = kuka
    first, second = pose(robot).split(",Z ")
    text = krl(*NULL, f"PTP {first}, ; half of it {{X 1}}", f"  Z {second} C_PTP")
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == [4, 5]
    assert done.report.poses == 1


def test_the_two_halves_of_a_krl_module_are_read_together(kuka, tmp_path):
    """The data say the points, the moves say the frames and what the program computes."""
    robot, _ = kuka
    data = f"DEFDAT P\nDECL E6POS XP1={pose(robot)}\nDECL E6POS XP2={pose(robot)}\nENDDAT\n"
    (tmp_path / "P.src").write_text(krl(*NULL, "PTP XP1", "XP2.Z=XP2.Z+5", "PTP XP2"))
    done = run(tmp_path / "P.dat", data, kuka)
    assert changed(done, data) == [2]
    assert reasons(done) == {3: "XP2 is computed while the program runs (line 5 of the other half of the module)"}


LEFT_RAPID = {
    "offset": ("MoveL Offs(p1,0,0,5),v9,fine,tool0;", 5, "Offs from p1 found: it gets the correction of that point"),
    "tool": ("t1.tframe.trans.z := 5;\nMoveL p2,v9,fine,t1;", 3, r"t1\.tframe\.trans\.z is changed in line 7"),
    "object": ("w1.uframe.trans.x := 5;\nMoveL p2,v9,fine,tool0\\WObj:=w1;", 3, r"w1\.uframe\.trans\.x is changed"),
    "frame": ("w1.oframe.trans := p2.trans;\nMoveL p2,v9,fine,tool0;", 3, r"p2 makes a tool or a work object"),
    "external": ("MoveL {E},v9,fine,tool0;", 7, "external axes are not at zero"),
    "tool offset": ("MoveL RelTool(p1,0,0,5),v9,fine,tool0;", 7, "RelTool from p1 found: it gets the correction"),
    **{f"cfx {k}": (f"MoveL {{cfx {k}}},v9,fine,tool0;", 7, f"cfx = {k} found; 0 … 3 are") for k in range(4, 8)},
    "handed on": ("pick p2;", 3, "may be changed by .pick p2. in line 7"),
    "handed to a function": ("ok:=GetPart(p2);\nMoveL p2,v9,fine,tool0;", 3, "p2 may be changed by 'ok:=GetPart"),
    "function in a branch": ("IF GetPart(p2) THEN\nENDIF\nMoveL p2,v9,fine,tool0;", 3, "p2 may be changed by 'IF"),
    "two tools": ("MoveL p2,v9,fine,tool0;\nMoveL p2,v9,fine,t1;", 3, "different tools or bases"),
    "add": ("Add t1.tframe.trans.z,50;\nMoveL p2,v9,fine,t1;", 3, r"t1 may be changed by 'Add t1\..*' in line 7"),
    "incr": ("Incr w1.uframe.trans.x;\nMoveL p2,v9,fine,tool0\\WObj:=w1;", 3, "w1 may be changed by 'Incr w1"),
    "handed tool": ("SetT t1;\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'SetT t1' in line 7"),
    "handed late": ('%"SetT"% t1;\nMoveL p2,v9,fine,t1;', 3, "t1 may be changed by"),
    "handed if": ("IF a=1 SetT t1;\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'IF a=1 SetT t1' in line 7"),
    "handed as option": ("SetT \\ To := t1;\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'SetT"),
    "function": ("a:=2*(SetF(3,(t1)));\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'a:=2"),
    "function in a condition": ("IF SetF(t1) THEN\nENDIF\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'IF SetF"),
    "calibration": ("MToolTCPCalib j1,j2,j3,j4,t1,a,b;\nMoveL p2,v9,fine,t1;", 3, "t1 may be changed by 'MToolTCPC"),
    "blanks": ("t1 . tframe . trans.z := 5;\nMoveL p2,v9,fine,t1;", 3, r"t1 \. tframe \. trans\.z is changed"),
    "object in place": (
        'MoveL p2,v9,fine,t1\\WObj:=[FALSE,TRUE,"",[[9,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
        3,
        "the work object of the move in line 7 is no name",
    ),
    "optional object": ("MoveL p2,v9,fine,t1\\WObj?w1;", 3, "the work object of the move in line 7 is no name"),
    "tool in place": (
        "MoveL p2,v9,fine,[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];", 3, "the tool of the move in line 7",
    ),
    "part of a point": ("Incr p2.trans.z;\nMoveL p2,v9,fine,t1;", 3, "p2 may be changed by 'Incr p2"),
    "tool behind a condition": ("IF SetF(t1) MoveL p2,v9,fine,t1;", 3, r"t1 may be changed by"),
    "target handed on": ("pick {E};", 7, "a target in 'pick "),
    "own move": ("MoveLCart {E},v9,fine,tool0;", 7, "a target in 'MoveLCart "),
}  # fmt: skip


@pytest.mark.parametrize("name", LEFT_RAPID)
def test_rapid_lines_that_are_not_certain_are_left_and_named(name, abb, tmp_path):
    body, line, why = LEFT_RAPID[name]
    line = 7 if name == "offset" else line
    body = body.replace("{E}", target(abb[0], external="500"))
    body = re.sub(r"\{cfx (\d)\}", lambda m: target(abb[0]).replace(",0],[9E9", f",{m[1]}],[9E9"), body)
    track = "0" if "[500," in body else "9E9"  # an axis that moves has a value in every target that is certain
    text = (
        f"MODULE M\nCONST robtarget p1:={target(abb[0], external=track)};\n"
        f"CONST robtarget p2:={target(abb[0], (5, 10, 20, 30, 40, 50), external=track)};\n"
        "PERS tooldata t1:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC main()\n"
        f"MoveL p1,v9,fine,tool0; {WOBJ}\n{body}\nENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert re.search(why, reasons(done)[line])
    assert 2 in changed(done, text)
    assert line not in changed(done, text)


def test_tools_that_are_only_read_stay_certain(abb, tmp_path):
    text = (
        f"MODULE M\nCONST robtarget p1:={target(abb[0])};\n"
        "PERS tooldata t1:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        f"PROC main()\n{WOBJ}\np9:=CRobT(\\Tool:=t1\\WObj:=w1);\na:=5*(b + t1.tframe.trans.z);\n"
        'TPWrite ""\\Num:=t1.tframe.trans.z;\nIF (t1.robhold) THEN\nMoveL p1, v9, fine, t1 \\WObj:=w1 \\Corr;\nENDIF\n'
        "ENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [2]
    assert not done.partly


WOBJ = 'PERS wobjdata w1:=[FALSE,TRUE,"",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'


def test_options_behind_a_target_in_place_are_read(abb, tmp_path):
    q = "[[10,20,10,20,40,30],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    text = (
        f"MODULE M\nPROC main()\nMoveAbsJ {q}\\NoEOffs,v9,fine,tool0;\nMoveL {target(abb[0])}\\ID:=10,v9,fine,tool0;\n"
        "ENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [3, 4]
    assert "\\NoEOffs,v9" in done.text
    assert "\\ID:=10,v9" in done.text
    assert not done.partly


@pytest.mark.slow
def test_points_of_one_name_belong_to_their_routine_and_module(abb, tmp_path):
    """Each p1 is a point of its own: corrected with the tool of its own moves."""
    robot, real = abb
    first, second = (target(robot, q) for q in ((10, 20, 10, 20, 40, 30), (-30, 10, 20, -20, 50, 10)))
    text = (
        f"MODULE A\nPROC one()\nCONST robtarget p1:={first};\nMoveJ p1,v9,fine,tool0;\nENDPROC\n"
        f"PROC two()\nCONST robtarget p1:={second};\nMoveJ p1,v9,fine,tool0;\nENDPROC\nENDMODULE\n"
        f"MODULE B\nCONST robtarget p1:={first};\nPROC three()\nMoveJ p1,v9,fine,tool0;\nENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, (robot, real))
    assert changed(done, text) == [3, 7, 12]
    alone = text.split("PROC two")[0] + "ENDMODULE\n"
    corrected = run(tmp_path / "q.mod", alone, (robot, real)).text.splitlines()[2]
    assert done.text.splitlines()[2] == done.text.splitlines()[11] == corrected


def test_a_parameter_hides_the_point_of_its_name(abb, tmp_path):
    text = (
        f"MODULE A\nCONST robtarget p1:={target(abb[0])};\nCONST robtarget p2:={target(abb[0])};\n"
        "PROC go(robtarget p2)\nMoveJ p1,v9,fine,tool0;\nMoveJ p2,v9,fine,tool0;\nENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [2]
    assert "no move of this file uses it" in reasons(done)[3]
    assert 6 in reasons(done)


def test_rows_of_robtargets_are_corrected_one_by_one(abb, tmp_path):
    text = (
        f"MODULE A\nCONST robtarget row{{2}}:=[{target(abb[0])},\n{target(abb[0], (5, 10, 20, 30, 40, 50))}];\n"
        "PROC go()\nFOR i FROM 1 TO 2 DO\nMoveJ row{i},v9,fine,tool0;\nENDFOR\nENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [2, 3]
    assert done.report.poses == 2


def test_without_confdata_the_arm_keeps_the_shape_in_which_it_comes(abb, tmp_path):
    """ConfL off, and a confdata that nobody has set: a pose behind a known one is certain, the first is not."""
    robot, _ = abb
    nonsense = re.sub(r"\],\[-?\d,-?\d,-?\d,\d\]", "],[0,0,0,1]", target(robot, (12, 22, 12, 22, 42, 33)))
    text = (
        f"MODULE A\nPROC go()\nConfL\\Off;\nMoveL {nonsense},v9,fine,tool0;\n"
        f"MoveAbsJ [[10,20,10,20,40,30],[9E9,9E9,9E9,9E9,9E9,9E9]],v9,fine,tool0;\nMoveL {nonsense},v9,fine,tool0;\n"
        "ENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [5, 6]
    assert "confdata is switched off in line 3" in reasons(done)[4]
    assert done.text.count("[0,0,0,1]") == 2


SERVICE = {
    "masref_user.src": (krl(*NULL, GOOD), r"file is a mastering or service point"),
    "p.src": (krl(GOOD).replace("DEF P", "DEF MASREF_TEST"), r"MASREF_TEST is a mastering or service point"),
    "p.dat": (
        f"DEFDAT P PUBLIC\nDECL E6AXIS XMASREF={GOOD[4:]}\nENDDAT\n",
        r"XMASREF is a mastering or service point",
    ),
    "p.mod": (
        "MODULE M\nCONST jointtarget sync_pos:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nENDMODULE\n",
        r"sync_pos is a mastering or service point",
    ),
}


@pytest.mark.parametrize("name", SERVICE)
def test_points_of_mastering_are_never_touched(name, kuka, tmp_path):
    text, why = SERVICE[name]
    with pytest.raises(InputError, match=why):
        run(tmp_path / name, text, kuka)


def test_the_head_lists_lines_as_they_are_counted_in_the_written_file(kuka, tmp_path):
    text = krl(*NULL, GOOD, "PTP XHOME", "LIN_REL {Z 5}", GOOD)
    done = run(tmp_path / "p.src", text, kuka)
    rows = done.text.splitlines()
    head = " ".join(row[2:] for row in rows if row.startswith("; "))
    at = [int(n) for n in re.search(r"Corrected lines: ([\d, ]+)\.", head)[1].split(",")]
    assert [rows[n - 1][:8] for n in at] == ["PTP {A1 ", "PTP {A1 "]
    left = [int(n) for n in re.findall(r"Left as written, lines (\d+):", head)]
    assert [rows[n - 1] for n in left] == ["PTP XHOME", "LIN_REL {Z 5}"]
    assert rows[0] == "DEF P ( )"
    again = run(tmp_path / "q.src", done.text, kuka)
    assert len(again.report.corrected) == 2


@pytest.mark.slow
def test_a_program_of_another_robot_is_told(kuka, tmp_path):
    with pytest.raises(InputError, match=r"p\.src:2: the program is for the robot 'comau-nj130'"):
        run(tmp_path / "p.src", krl("; robot: comau-nj130", "; plan_id: 0123456789ab", GOOD), kuka)
    done = run(tmp_path / "p.src", krl("; cell 4, KR 210 R2700 prime", GOOD), kuka)
    assert [line for line, why in done.report.notes if "KR 210 R2700" in why] == [2]
    assert not run(tmp_path / "p.src", krl("; KUKA KR 6 R700 sixx", GOOD), kuka).report.notes
    far = [f"PTP {{X {x},Y 0,Z 1500,A 0,B 90,C 0,S 2,T 2}}" for x in (1500, 1800, 2000)]
    with pytest.raises(NoSolutionError, match=r"3 of 4 targets are out of reach .* program of another robot"):
        run(tmp_path / "p.src", krl(*NULL, GOOD, *far), kuka)


@pytest.mark.slow
def test_the_command_says_by_its_exit_code_what_was_done(tmp_path):
    text = (data_folder("robots") / "kuka-kr6-r700" / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(text.replace("a_mm = 315.0", "a_mm = 315.4") + "[nominal]\na2_mm = 315.0\n")
    path, out = tmp_path / "p.src", tmp_path / "out.src"

    def compensate(body, *more):
        path.write_text(krl(*body))
        out.unlink(missing_ok=True)
        done = edbb("compensate", path, "--model", tmp_path / "robot.toml", "-o", out, *more)
        assert ("SIMULATED" in done.screen) == (tmp_path / "identification.json").exists()
        return done.returncode, out.exists()

    assert compensate([GOOD]) == (0, True)
    assert compensate([GOOD, "PTP XHOME"]) == (5, True)
    assert compensate([GOOD, "PTP XHOME"], "--strict") == (2, False)
    assert compensate(["PTP XHOME"]) == (2, False)
    assert compensate([*NULL, "PTP {X 5000,Y 0,Z 0,A 0,B 90,C 0,S 2,T 2}"]) == (3, False)
    (tmp_path / "identification.json").write_text('{"simulated": true}')
    assert compensate([GOOD]) == (0, True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kuka-kr6-r700", "abb-irb120"])
def test_the_output_of_a_real_file_is_read_and_corrected_again(name, tmp_path):
    """Never refused by its own tool: what was written is read as the same targets, at which nothing is left to move."""
    robot, real = bent(name, seed=6)
    poses = regular_angles(robot, 12, seed=6, margin=0.2)
    if name.startswith("kuka"):
        path, rows = tmp_path / "p.src", [f"PTP {pose(robot, np.degrees(q))}" for q in poses]
        text = krl(*NULL, *rows)
    else:
        path = tmp_path / "p.mod"
        rows = [f"MoveJ {target(robot, np.degrees(q))},v9,fine,tool0;" for q in poses if abs(q[0]) < 1 and q[4] > 0]
        text = "\n".join(["MODULE M", "PROC main()", *rows, "ENDPROC", "ENDMODULE", ""])
    done = run(path, text, (robot, real))
    again = run(path, done.text, (load_robot(name), exact(robot)))
    assert again.report.shift_max_m < 1e-6
    assert len(again.report.corrected) == len(done.report.corrected)


@pytest.mark.slow
def test_what_other_modules_do_to_a_work_object_counts(abb, tmp_path):
    """Code of the modules that are given beside the file changes frames as that of the file itself does."""
    frame = 'wV:=[FALSE,TRUE,"",[[10,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];'
    beside = f"MODULE Cal\nPERS wobjdata {frame}\nPROC Up(num x)\n{{do}}\nENDPROC\nENDMODULE\n"
    text = (
        f"MODULE M\nCONST robtarget p1:={target(abb[0])};\nCONST robtarget p2:={target(abb[0])};\nPROC main()\n"
        "Up 3;\nMoveL p1,v9,fine,tool0\\WObj:=wV;\nMoveL p2,v9,fine,tool0;\nENDPROC\nENDMODULE\n"
    )

    def correct(do):
        return run(tmp_path / "p.mod", text, abb, frames=ToolAndBase(data=beside.replace("{do}", do)))

    done = correct("wV.oframe.trans.x:=x;")
    assert "wV.oframe.trans.x is changed in line 4 of module cal" in reasons(done)[2]
    head = " ".join(done.text.replace("!", " ").split())
    assert "line 4 of module cal" in head  # the head counts the lines of its own file anew, and of no other
    with pytest.raises(InputError, match="PDispSet in line 4 of module cal"):
        correct("PDispSet x;")
    assert changed(correct("x:=3;"), text) == [2, 3]
    assert "p1 is computed while the program runs (line 4 of module cal)" in reasons(correct("p1.trans.x:=x;"))[2]
    assert (
        "different tools" in reasons(correct("MoveL p1,v9,fine,tool0\\WObj:=wV;MoveL p2,v9,fine,tool0\\WObj:=wV;"))[3]
    )
    noted = correct("MCalib wV;")
    assert changed(noted, text) == [2, 3]
    assert "wV may be changed by 'MCalib wV' in line 4 of module cal: taken as it is in the files" in noted.summary


def test_options_stand_for_what_the_file_lacks_alone(abb, tmp_path):
    """A tool that the person names is none that the file declares, or one of several that it does not."""
    points = "".join(f"CONST robtarget p{k}:={target(abb[0])};\n" for k in (1, 2, 3))
    data = 'PERS wobjdata wC:=[FALSE,FALSE,"STN_1",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    moves = (
        "MoveL p1,v9,fine,tUnk;\nMoveL p2,v9,fine,tUnk\\WObj:=wC;\nMoveL Offs(p3,0,0,9),v9,fine,tool0;\npc:=p3;\n"
        "MoveL p3,v9,fine,tUnk;\n"
    )
    text = f"MODULE M\n{points}{data}PROC main()\n{moves}ENDPROC\nENDMODULE\n"
    done = run(tmp_path / "p.mod", text, abb, frames=FREE)
    assert changed(done, text) == [2]
    assert "wc (line 5) stands still, is moved or is not declared with plain numbers" in reasons(done)[3]
    text = text.replace("pc:=p3;", "MoveL p3,v9,fine,tOther;")
    with pytest.raises(InputError, match="tUnk is not declared with plain numbers"):
        run(tmp_path / "p.mod", text, abb, frames=FREE)


def test_an_option_is_no_value_of_a_parameter(abb, tmp_path):
    rows = "PERS tooldata tA{2}:=[[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]]];\n"
    for tool in ("t", "tA{i}", "tc"):
        text = (
            f"MODULE M\nCONST robtarget p1:={target(abb[0])};\n{rows}PROC pick(PERS tooldata t)\nVAR tooldata tc;\n"
            f"MoveL p1,v9,fine,{tool};\nENDPROC\nENDMODULE\n"
        )
        with pytest.raises(InputError, match=r"is a parameter, a variable or one of a row|is not declared with plain"):
            run(tmp_path / "p.mod", text, abb, frames=FREE)


def test_confdata_of_a_label_do_not_come_from_the_line_above(abb, tmp_path):
    text = (
        "MODULE M\nPROC main()\nConfL\\Off;\nMoveAbsJ [[10,20,10,20,40,30],[9E9,9E9,9E9,9E9,9E9,9E9]],v9,fine,tool0;\n"
        f"CASE 2: MoveL {target(abb[0])},v9,fine,tool0;\nENDPROC\nENDMODULE\n"
    )
    done = run(tmp_path / "p.mod", text, abb)
    assert "confdata is switched off in line 3, and the target that the arm comes from" in reasons(done)[5]
