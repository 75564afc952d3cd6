"""Targets that hide: each is corrected, or left and named by its line, or the file is refused; never silently wrong."""

import contextlib
import re
import time

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from planner.workflow.compensation import compensate
from tests.compensation.robots import exact, flange_pose
from tests.compensation.test_cartesian import abc_of
from tests.compensation.test_formats import krl
from tests.compensation.test_partial import FREE, GOOD, GOOD_RAPID, NULL, changed, pose, reasons, run, target

AXES = GOOD[4:]
LEFT_KRL = {  # row, why; it stands in line 5
    "home of the controller": ("PTP $H_POS", r"\$H_POS found: a position that the controller keeps"),
    "home by number": ("PTP $AXIS_HOME[1]", r"\$AXIS_HOME\[1\] found: a position that the controller keeps"),
    "where it was left": ("LIN $POS_RET", r"\$POS_RET found: a position that the controller keeps"),
    "home set": ("$H_POS={A}", "found; targets of moves"),
    "handed to a routine": ("GRIP({P})", "found; targets of moves"),
    "handed to a function": ("OK=GRIP({A})", "found; targets of moves"),
    "inverse": ("XA=INVERSE({P},$AXIS_ACT,ERR)", "found; targets of moves"),
    "in a structure": ("S1={P1 {P},V 5}", "found; targets of moves"),
    "behind a condition": ("IF $IN[1] THEN PTP {P}", "found; targets of moves"),
    "behind a condition, by name": ("IF $IN[1] THEN PTP XP1", "'?IF .* PTP XP1'? found"),
    "angle of a circle": ("CIRC {P},{P},CA 270", "the angle CA in line 5 ends the circle elsewhere"),
    "angle of a spline circle": ("SCIRC {P},{P}, CA=90 WITH $VEL.CP=1", "CA in line 5 ends the circle elsewhere"),
}


@pytest.mark.parametrize("name", LEFT_KRL)
def test_krl_targets_that_hide_are_left_and_named(name, kuka, tmp_path):
    row, why = LEFT_KRL[name]
    row = row.replace("{P}", pose(kuka[0])).replace("{A}", AXES)
    text = krl(*NULL, GOOD, row, GOOD)
    done = run(tmp_path / "p.src", text, kuka)
    assert re.search(why, reasons(done)[5])
    assert changed(done, text) == [4, 6]


def test_krl_moves_to_where_the_arm_stands_are_no_targets(kuka, tmp_path):
    done = run(tmp_path / "p.src", krl("PTP $AXIS_ACT", GOOD, "PTP $POS_ACT"), kuka)
    assert not done.partly


def test_krl_values_of_zero_are_places_that_the_program_fills(kuka, tmp_path):
    row = "LOG[1]={POSE 1,AX {A1 0.0,A2 0.0,A3 0.0,A4 0.0,A5 0.0,A6 0.0}}"
    assert not run(tmp_path / "p.src", krl(GOOD, row), kuka).partly


@pytest.mark.parametrize("head", ["DEFDAT P PUBLIC", "DEFDAT $CONFIG PUBLIC"])
def test_krl_global_poses_belong_to_whoever_drives_there(head, kuka, tmp_path):
    """Its tool and base are those of a program elsewhere; joint angles need neither."""
    word = "GLOBAL " if "$" not in head else ""
    (tmp_path / "p.src").write_text(krl(*NULL, "PTP XP1", GOOD))
    text = f"{head}\nDECL {word}E6POS XP1={pose(kuka[0])}\nDECL {word}E6AXIS XA={AXES}\nENDDAT\n"
    done = run(tmp_path / "p.dat", text, kuka, frames=FREE)
    assert changed(done, text) == [3]
    assert reasons(done)[2] == "XP1 is global: programs of other files may drive to it with another tool or base"
    (tmp_path / "p.dat").write_text(text)
    assert "XP1 is global" in reasons(compensate_file(tmp_path / "p.src", *kuka))[4]


def test_krl_private_poses_of_a_public_file_keep_their_frames(kuka, tmp_path):
    (tmp_path / "p.src").write_text(krl(*NULL, "PTP XP1", GOOD))
    text = f"DEFDAT P PUBLIC\nDECL E6POS XP1={pose(kuka[0])}\nENDDAT\n"
    assert changed(run(tmp_path / "p.dat", text, kuka), text) == [2]


def test_krl_a_name_that_gets_an_expression_in_braces_is_computed(kuka, tmp_path):
    (tmp_path / "p.src").write_text(krl(*NULL, "XP1={X XNEW,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}", "PTP XP1", GOOD))
    text = f"DEFDAT P\nDECL E6POS XP1={pose(kuka[0])}\nDECL E6AXIS XA={AXES}\nENDDAT\n"
    done = run(tmp_path / "p.dat", text, kuka)
    assert "XP1 is computed while the program runs (line 4 of the other half" in reasons(done)[2]


def test_krl_moves_to_points_of_the_other_half_are_left_to_it(kuka, tmp_path):
    (tmp_path / "p.dat").write_text(f"DEFDAT P\nDECL E6POS XP1={pose(kuka[0])}\nENDDAT\n")
    text = krl(*NULL, "PTP XP1", GOOD)
    done = run(tmp_path / "p.src", text, kuka)
    assert reasons(done) == {}
    assert changed(done, text) == [5]
    assert done.others == (tmp_path / "p.dat",)


@pytest.mark.parametrize("head", ["SPLINE", "SPLINE WITH $VEL.CP=1.0", "PTP_SPLINE WITH $VEL_AXIS[1]=50"])
def test_krl_splines_keep_the_frames_that_hold(head, kuka, tmp_path):
    move = "SPTP" if head.startswith("PTP") else "SPL"
    text = krl(*NULL, head, f"{move} {pose(kuka[0])}", "ENDSPLINE")
    assert changed(run(tmp_path / "p.src", text, kuka), text) == [5]


def test_krl_splines_that_say_a_base_are_left(kuka, tmp_path):
    text = krl(*NULL, GOOD, "SPLINE WITH $BASE={X 9,Y 0,Z 0,A 0,B 0,C 0}", f"SPL {pose(kuka[0])}", "ENDSPLINE")
    done = run(tmp_path / "p.src", text, kuka)
    assert changed(done, text) == [4]
    assert "line 5 sets it" in reasons(done)[6]


def rapid(*rows, data=()):
    return "\n".join(["MODULE M", *data, "PROC main()", *rows, GOOD_RAPID, "ENDPROC", "ENDMODULE", ""])


@pytest.mark.parametrize("word", ["Wrist", "LockAxis4", "LockAxis4 \\Off"])
@pytest.mark.parametrize("first", [True, False])
def test_rapid_lines_that_do_not_keep_the_orientation_are_left(word, first, abb, tmp_path):
    """The tool ends otherwise than written; it holds until another SingArea, and over the start of the next cycle."""
    line, joint = (f"Move{k} {target(abb[0])},v9,fine,tool0;" for k in "LJ")
    text = rapid(*([f"SingArea \\{word};", line] if first else [line, f"SingArea\\{word};"]), joint)
    done = run(tmp_path / "p.mod", text, abb)
    row = 4 if first else 3
    assert reasons(done).keys() == {row}
    assert "lets the tool turn otherwise in a line or a circle" in reasons(done)[row]
    assert changed(done, text) == [5, 6]


@pytest.mark.slow
def test_rapid_lines_after_singarea_off_are_corrected(abb, tmp_path):
    line = f"MoveL {target(abb[0])},v9,fine,tool0;"
    rows = ["SingArea \\Wrist;", line, "SingArea \\Off;", line, "IF a THEN", "SingArea \\LockAxis4;", "ENDIF", line]
    text = rapid(*rows)
    done = run(tmp_path / "p.mod", text, abb)
    assert list(reasons(done)) == [4, 10]
    assert changed(done, text) == [6, 11]
    alone = rapid("SingArea \\Off;", line)
    assert not run(tmp_path / "q.mod", alone, abb).partly


LEFT_RAPID = {  # row in line 4, why
    "handed to a function": ("j:=CalcJointT({R},tool0);", "a target in 'j:=CalcJointT"),
    "in a record": ("CONST station s1:=[5,{R}];", "a target in 'CONST station"),
    "in a condition": ("IF IsThere({R}) THEN\nENDIF", "a target in 'IF IsThere"),
    "of another module": ("pElse:={R};", "a target in 'pElse:="),
    "of who calls": ("p9:={R};", "a target in 'p9:="),
    "of a row": ("pR{2}:={R};", "a target in 'pR{2}:="),
}


@pytest.mark.parametrize("name", LEFT_RAPID)
def test_rapid_targets_that_hide_are_left_and_named(name, abb, tmp_path):
    row, why = LEFT_RAPID[name]
    text = f"MODULE M\nVAR robtarget pR{{3}};\nPROC do(INOUT robtarget p9)\n{row}\n{GOOD_RAPID}\nENDPROC\nENDMODULE\n"
    text = text.replace("{R}", target(abb[0]))
    done = run(tmp_path / "p.mod", text, abb)
    assert why in reasons(done)[4]
    assert list(done.report.corrected) == [text[: text.index("MoveAbsJ")].count("\n") + 1]


@pytest.mark.slow
def test_a_rapid_variable_that_gets_one_value_is_corrected_there(abb, tmp_path):
    """And with two it has none that is certain."""
    data, first = ["VAR robtarget p1;"], f"p1:={target(abb[0])};"
    text = rapid(first, "MoveL p1,v9,fine,tool0;", data=data)
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [4, 6]
    assert not done.partly
    second = first.replace("p1:=", "p1:=").replace(target(abb[0]), target(abb[0], (5, 10, 20, 30, 40, 50)))
    text = rapid(first, second, "MoveL p1,v9,fine,tool0;", data=data)
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [7]
    assert {4, 5} <= reasons(done).keys()
    text = rapid(first, "p1.trans.z:=5;", "MoveL p1,v9,fine,tool0;", data=data)
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [7]
    assert {4, 6} <= reasons(done).keys()


@pytest.mark.parametrize(
    "mover",
    [
        "MoveJ {E},v9,fine,tool0;",
        "MoveExtJ jTrack,v9,fine;",
        "IndAMove TRACK,1\\ToAbsNum:=500,20;",
        "p2.extax.eax_a:=500;",
        "p2.extax:=found;",
    ],
)
def test_rapid_external_axes_keep_their_value_where_none_is_said(mover, abb, tmp_path):
    """The arm may stand on that axis."""
    text = rapid(mover.replace("{E}", target(abb[0], external="500")), f"MoveJ {target(abb[0])},v9,fine,tool0;")
    done = run(tmp_path / "p.mod", text, abb)
    assert "external axis eax_a has no value here and keeps its last one" in reasons(done)[4]
    assert changed(done, text) == [5]


G_CODE = "G17 G21 G90\n{offset}\n{whole}G0 X10 Y-20 Z10 A20 B30 C5\n{whole}G1 X12 F100\nM2\n"


@pytest.mark.parametrize(("offset", "whole"), [("G54", ""), ("", ""), ("", "G53 ")])
def test_linuxcnc_words_are_joint_angles_only_where_somebody_says_so(offset, whole, abb, tmp_path):
    """The kinematics stand in the machine's INI, not in the program: the same words are a place elsewhere."""
    path, text = tmp_path / "p.ngc", G_CODE.format(offset=offset, whole=whole)
    path.write_text(text)
    with pytest.raises(InputError, match=r"trivkins; elsewhere they are a place.*--dialect linuxcnc"):
        compensate_file(path, *abb)
    if not whole:
        after = " after G54" if offset else ""
        with pytest.raises(InputError, match=rf"p\.ngc:3: no G53{after}: the work offset is not known"):
            compensate_file(path, *abb, dialect="linuxcnc")
        return
    assert changed(compensate_file(path, *abb, dialect="linuxcnc"), text) == [3, 4]
    path.write_text("(plan_id: 0123456789ab)\n" + text.replace("G54", "M9"))
    assert compensate_file(path, *abb).report.joint_targets == 2


def test_a_frame_of_its_own_is_no_hidden_target(kuka, tmp_path):
    text = krl("BASE_DATA[3]={X 5,Y 0,Z 0,A 0,B 0,C 0}", "$LOAD={M 5,CM {X 1,Y 2,Z 3,A 0,B 0,C 0}}", GOOD)
    assert not run(tmp_path / "p.src", text, kuka, frames=ToolAndBase()).partly


MODULE_HEAD = f"MODULE M\nPROC main()\n{GOOD_RAPID}\n"
MANY = {  # name, text, frames: each was read in a time that grows with the square of its size
    "braces of frames": ("p.mod", f"{MODULE_HEAD}ENDPROC\nENDMODULE\n", "MODULE F\n" + "a{ \n" * 20_000),
    "names of frames": ("p.mod", f"{MODULE_HEAD}ENDPROC\nENDMODULE\n", "MODULE F\n" + "a \n" * 20_000),
    "braces and numbers": ("p.mod", MODULE_HEAD + "{X 1\n" * 20_000 + ";ENDPROC\nENDMODULE\n", ""),
    "nested conditions": ("p.src", krl(GOOD, *["IF a THEN"] * 10_000), ""),
    "spaces behind a word": ("p.src", krl(GOOD, *["IF PTP" + " " * 19_000 + "THEN"] * 5), ""),
    "lines that are left": ("p.src", krl(GOOD, *["PTP XELSE"] * 10_000), ""),
    "empty lines of TP": ("p.ls", "/MN\n:J P[1] 9% FINE ;\n" + "\n" * 20_000 + "/POS\n/END\n", ""),
    "empty lines of G-code": ("p.mpf", "G500 G90\n" + "\n" * 20_000 + "M30\n", ""),
    "rows that are refused": ("p.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n" + "x\n" * 20_000, ""),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MANY)
def test_long_files_are_read_once(name, kuka, abb, tmp_path):
    file, text, frames = MANY[name]
    (tmp_path / file).write_text(text)
    start = time.process_time()
    with contextlib.suppress(InputError):
        compensate_file(tmp_path / file, *(kuka if file.endswith(".src") else abb), frames=ToolAndBase(data=frames))
    assert time.process_time() - start < 20.0  # of the processor, however busy the machine is: most take a second


def test_a_table_of_frames_is_read_as_a_program_is(tmp_path):
    robot = (data_folder("robots") / "abb-irb120" / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(f"{robot}\n[nominal]\na2_mm = 270.1\n")
    (tmp_path / "p.mod").write_text(f"{MODULE_HEAD}ENDPROC\nENDMODULE\n")
    (tmp_path / "frames.mod").write_text("MODULE F " + "{" * 200_000)
    with pytest.raises(InputError, match=r"frames\.mod:1: the line has 200009 signs; at most 20000 are read"):
        compensate(tmp_path / "p.mod", model=tmp_path / "robot.toml", frames=tmp_path / "frames.mod")


SCRIPTS = {  # digits that are none to a controller
    "p.src": krl(GOOD, "PTP {A1 ٣,A2 -80,A3 100,A4 20,A5 40,A6 30}"),
    "p.mod": f"MODULE M\nPROC main()\n{GOOD_RAPID}\n{GOOD_RAPID.replace('[10,', '[٣,')}\nENDPROC\nENDMODULE\n",
    "p.script": "def p():\n movej([0.1,-0.2,0.1,0.2,0.5,0.1])\n movej([0.٣,-0.2,0.1,0.2,0.5,0.1])\nend\n",
    "p.csv": "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,20,40,30\n٣,20,10,20,40,30\n",
    "p.mpf": "G500 G90\nG0 A1=10 A2=-20 A3=10 A4=20 A5=30 A6=5\nG0 A1=٣\nM30\n",
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_digits_of_other_scripts_are_no_numbers(name, kuka, abb, tmp_path):
    (tmp_path / name).write_text(SCRIPTS[name], encoding="utf-8")
    robot = kuka if name.endswith(".src") else abb
    if name.endswith(("csv", "mpf")):
        with pytest.raises(InputError, match=rf"{name}:3: .*٣"):
            compensate_file(tmp_path / name, *robot)
    else:
        done = compensate_file(tmp_path / name, *robot)
        assert len(done.report.corrected) == 1
        assert any("٣" in why for _, why in done.report.kept)


def script(*rows):
    return "\n".join(["def p():", " movej([0.1,-0.2,0.1,0.2,0.5,0.1])", *(f" {row}" for row in rows), "end", ""])


LEFT_UR = {  # rows, lines that are left, lines that are corrected beside line 2
    "pose in a variable": (["W=p[0.4,0.2,0.3,0,3.1,0]", "movel(W)"], [3, 4], []),
    "joints handed on": (["go([0.2,-0.2,0.1,0.2,0.5,0.1], 1)"], [3], []),
    "row of joints": (["w=[[0.2,-0.2,0.1,0.2,0.5,0.1],[0,0,0,0,1,0]]", "movej(w[0])"], [3, 4], []),
    "between two": (["s=interpolate_pose(p[1,2,3,4,5,6],a,0.5)"], [3], []),
    "tool": (["set_tcp(p[0,0,0.1,0,0,0.1])", "set_gravity([0,0,9.8])"], [], []),
    "joints in a variable": (["global q=[0.2,-0.2,0.1,0.2,0.5,0.1]", "movej(q, a=1, v=1)", "movej(q)"], [], [3]),
    "changed": (["q=[0.2,-0.2,0.1,0.2,0.5,0.1]", "q[0]=0.3", "movej(q)"], [3, 5], []),
    "given twice": (["q=[0.2,-0.2,0.1,0.2,0.5,0.1]", "q=[0.3,-0.2,0.1,0.2,0.5,0.1]", "movej(q)"], [3, 4, 5], []),
    "copied": (["q=[0.2,-0.2,0.1,0.2,0.5,0.1]", "r=q", "movej(q)", "movej(r)"], [3, 5, 6], []),
    "statements of the network": (["interpreter_mode()"], [3], []),
    "read by a line": (["q=[0.2,-0.2,0.1,0.2,0.5,0.1]", "movel(q)"], [3, 4], []),
}


@pytest.mark.parametrize("name", LEFT_UR)
def test_urscript_targets_outside_of_moves(name, abb, tmp_path):
    rows, left, corrected = LEFT_UR[name]
    done = run(tmp_path / "p.script", script(*rows), abb)
    assert sorted(reasons(done)) == left
    assert list(done.report.corrected) == [2, *corrected]


def test_pdl2_places_in_variables_are_named(abb, tmp_path):
    rows = ["pnt1 := POS(1, 2, 3, 4, 5, 6, '')", "$TOOL := POS(0, 0, 9, 0, 0, 0, '')", "MOVE LINEAR TO pnt1"]
    text = "\n".join(["PROGRAM p", "BEGIN", "  MOVE TO {10,-20,10,20,30,5}", *rows, "END p", ""])
    done = run(tmp_path / "p.pdl", text, abb)
    assert sorted(reasons(done)) == [4, 6]
    assert list(done.report.corrected) == [3]


@pytest.mark.parametrize("length", [0.0, 0.2])
def test_a_table_of_poses_of_a_tool_that_nobody_names_is_left(length, abb, tmp_path):
    """The pose of a gripper, taken for the flange's, is solved with other angles than those beside it."""
    q = np.radians([10.0, 20.0, 10.0, 20.0, 40.0, 30.0])
    T = flange_pose(exact(abb[0]), q)
    T[:3, 3] += length * T[:3, 2]
    head = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg," + ",".join(f"q{i}_deg" for i in range(1, 7))
    text = f"{head}\n" + ",".join(f"{v:.6f}" for v in (*abc_of(T), *np.degrees(q))) + "\n"
    path = tmp_path / "t.csv"
    path.write_text(text)
    gripper = np.eye(4)
    gripper[2, 3] = length
    assert compensate_file(path, *abb, frames=ToolAndBase(gripper)).report.poses == 1
    if length:
        with pytest.raises(InputError, match=r"t\.csv:2: the pose is 200 mm from where the arm stands"):
            compensate_file(path, *abb)
    else:
        assert compensate_file(path, *abb).report.poses == 1


def test_a_table_whose_named_tool_contradicts_the_joint_angles_beside_its_poses_is_doubted(abb, tmp_path):
    q = np.radians([[10.0, 20.0, 10.0, 20.0, 40.0, 30.0], [15.0, 20.0, 10.0, 20.0, 40.0, 30.0]])
    gripper = np.eye(4)
    gripper[2, 3] = 0.2
    T = [flange_pose(exact(abb[0]), row) @ gripper for row in q]
    head = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg," + ",".join(f"q{i}_deg" for i in range(1, 7))
    rows = [",".join(f"{v:.6f}" for v in (*abc_of(t), *np.degrees(row))) for t, row in zip(T, q, strict=True)]
    path = tmp_path / "t.csv"
    path.write_text("\n".join([head, *rows, ""]))
    doubt = "2 of 2 poses are up to 200 mm and 0° from where the arm stands"
    for named, said in ((gripper, False), (np.eye(4), True)):
        done = compensate_file(path, *abb, frames=ToolAndBase(named))
        assert (doubt in " ".join(done.summary.split())) == said


@pytest.mark.parametrize("other", [False, True])
def test_a_rapid_point_that_is_copied_stays_certain_where_the_copy_is_named(other, abb, tmp_path):
    """Moves to the copy are left; a copy that another module has may be driven to with any tool."""
    data = [f"CONST robtarget p1:={target(abb[0])};", "VAR robtarget pt;"]
    text = rapid("pt:=p1;", "pt.trans.z:=pt.trans.z+50;", "MoveL pt,v9,z1,tool0;", "MoveL p1,v9,fine,tool0;", data=data)
    if other:
        text = text.replace("VAR robtarget pt;", "VAR num n;")
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == ([9] if other else [2, 9])
    assert (2 in reasons(done)) == other
    assert 7 in reasons(done)


def test_a_rapid_point_whose_copy_is_handed_on_is_left(abb, tmp_path):
    data = [f"CONST robtarget p1:={target(abb[0])};", "VAR robtarget pt;", "VAR robtarget pu;"]
    text = rapid("pt:=p1;", "pu:=pt;", "pick pu;", "MoveL p1,v9,fine,tool0;", data=data)
    done = run(tmp_path / "p.mod", text, abb)
    assert changed(done, text) == [10]
    assert "it is handed on in line 8" in reasons(done)[2]


def test_the_mark_of_an_encoding_before_the_first_line_hides_no_routine(kuka, tmp_path):
    """A frame that gets its value in a branch is none of the whole file."""
    frame = "{X 5,Y 0,Z 0,A 0,B 0,C 0}"
    rows = [*NULL, GOOD, "IF $IN[1] THEN", f"BASE_DATA[1]={frame}", "ENDIF", "$BASE=BASE_DATA[1]"]
    text = "\ufeff" + krl(*rows, f"PTP {pose(kuka[0])}")
    done = run(tmp_path / "p.src", text, kuka)
    assert list(reasons(done)) == [9]


@pytest.mark.parametrize("sign", ["\x0c", "\x0b", "\u2028"])
def test_lines_of_gcode_end_where_a_controller_ends_them(sign, abb, tmp_path):
    """The second program of a file begins anew, whatever stands in remarks."""
    row = "G0 A1=10 A2=-20 A3=10 A4=20 A5=30 A6=5"
    text = f"%1\nG500 G90\n;{sign * 3}\n{row}\nM9\n%2\nG0 A1=11\nM30\n"
    (tmp_path / "p.mpf").write_text(text, encoding="utf-8", newline="")
    with pytest.raises(InputError, match=r"p\.mpf:7: the angle of A2, A3, A4, A5, A6 is not known"):
        compensate_file(tmp_path / "p.mpf", *abb)


def test_pdl2_moves_in_texts_and_of_an_arm_that_changes_are_named(abb, tmp_path):
    move = "MOVE TO {10,-20,10,20,30,5}"
    text = f"PROGRAM p\nBEGIN\n{move}\nEXECUTE 'MOVE TO {{1,2,3,4,5,6}}'\nEXECUTE cmd\nEND p\n"
    done = run(tmp_path / "p.pdl", text, abb)
    assert sorted(reasons(done)) == [4, 5]
    for change in ("$PROG_ARM := 2", f"{move} WITH $PROG_ARM = 2"):
        (tmp_path / "q.pdl").write_text(f"PROGRAM p\nBEGIN\n{move}\n{change}\n{move}\nEND p\n")
        with pytest.raises(InputError, match=r"q\.pdl:3: .* an arm that is not certain.*set in line 4(.|\n)*q\.pdl:5:"):
            compensate_file(tmp_path / "q.pdl", *abb)


SUBPROGRAMS = {  # file, text, what its line 3 lacks (nothing where it is corrected)
    "relative or not": ("u.SPF", "PROC U\nG153\nG153 G1 {A}\nRET\n", "whether G90 or G91 holds is its caller's"),
    "frames": ("u.SPF", "PROC U SAVE\nG90\nG1 {A}\nM17\n", "frames and offsets are its caller's"),
    "no head": ("u.SPF", "; grip\nG90\nG1 {A}\nM17\n", "frames and offsets are its caller's"),
    "by its end": ("u.nc", "%\nG94\nG53 G1 {A}\nM99\n", "whether G90 or G91 holds is its caller's"),
    "whole": ("u.SPF", "PROC U\nG90\nG153 G1 {A}\nRET\n", ""),
    "cleared": ("u.SPF", "TRANS\nG90 G500 D0\nG1 {A}\nM17\n", ""),
    "main": ("u.MPF", "; main\nG500\nG1 {A}\nM30\n", ""),
}


@pytest.mark.parametrize("name", SUBPROGRAMS)
def test_subprograms_of_gcode_say_what_their_callers_may_have_changed(name, abb, tmp_path):
    file, text, why = SUBPROGRAMS[name]
    text = text.replace("{A}", "A1=10 A2=-20 A3=10 A4=20 A5=30 A6=5")
    (tmp_path / file).write_text(text)
    if why:
        with pytest.raises(InputError, match=rf"{file}:3: .*{why}"):
            compensate_file(tmp_path / file, *abb)
    else:
        assert changed(compensate_file(tmp_path / file, *abb), text) == [3]


@pytest.mark.parametrize("row", ["G1 A01=5", "G1 J1=5", "E1=100", "G1 AP=30 RP=50", "G1 AXIS1=5", "J1=5"])
def test_words_of_gcode_that_may_be_an_axis_are_refused(row, abb, tmp_path):
    text = f"DEF INT NR\nG500 G90\nG0 A1=10 A2=-20 A3=10 A4=20 A5=30 A6=5\nNR=5\nCOUNT=7\nR1=3\n{row}\nM30\n"
    (tmp_path / "p.mpf").write_text(text)
    with pytest.raises(InputError, match=r"p\.mpf:7: ") as caught:
        compensate_file(tmp_path / "p.mpf", *abb)
    assert "p.mpf:4" not in str(caught.value)
    (tmp_path / "q.mpf").write_text(text.replace(row, "M9"))
    assert compensate_file(tmp_path / "q.mpf", *abb).report.joint_targets == 1


@pytest.mark.parametrize("row", ["CONV_TRACK(1)", "SENSOR_TRK(ON)", "$SENSOR_ENBL := ON"])
def test_pdl2_motion_that_a_belt_or_a_sensor_adds_is_refused(row, abb, tmp_path):
    (tmp_path / "p.pdl").write_text(f"PROGRAM p\nBEGIN\n{row}\nMOVE LINEAR TO {{10,-20,10,20,30,5}}\nEND p\n")
    with pytest.raises(InputError, match=r"p\.pdl:3: .*adds to the targets"):
        compensate_file(tmp_path / "p.pdl", *abb)


def test_krl_points_taught_with_negative_numbers_are_left(kuka, tmp_path):
    (tmp_path / "p.src").write_text(krl("FDAT_ACT=FP1", "BAS(#PTP_PARAMS,100)", "PTP XP1"))
    fdat = "DECL FDAT FP1={TOOL_NO -1,BASE_NO 0,IPO_FRAME #BASE}"
    text = f"DEFDAT P\nDECL E6POS XP1={pose(kuka[0])}\n{fdat}\nDECL E6AXIS XA={AXES}\nENDDAT\n"
    done = run(tmp_path / "p.dat", text, kuka)
    assert "name no tool or no base: their number is negative" in reasons(done)[2]
    assert changed(done, text) == [4]
    assert changed(run(tmp_path / "p.dat", text.replace("-1", "0"), kuka), text.replace("-1", "0")) == [2, 4]


CHANGES_OF_A_FRAME = {  # rows of the program, BT being a frame of the module's data; the line that changes it
    "component": (["BT.Z=BT.Z+0.5", "$BASE=BT", "PTP XP1"], 4),
    "whole": (["BT=CamFrame()", "$BASE=BT", "PTP XP1"], 4),
    "behind the move": (["$BASE=BT", "PTP XP1", "BT.Z=BT.Z+0.5"], 7),
    "whole, behind the move": (["$BASE=BT", "PTP XP1", "BT=CamFrame()"], 7),
    "plain numbers": (["$BASE=BT", "PTP XP1", "BT={X 9,Y 0,Z 0,A 0,B 0,C 0}"], 7),
    "trigger": (["$BASE=BT", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO BT=OTHER", "PTP XP1"], 6),
    "analog input": (["ANIN ON BT.Z=1.0*SIG", "$BASE=BT", "PTP XP1"], 4),
    "handed on": (["measure(BT)", "$BASE=BT", "PTP XP1"], 4),
    "a row handed on": (["measure(BR[])", "$BASE=BR[1]", "PTP XP1"], 4),
    "one of a row handed on": (["measure(BR[I])", "$BASE=BR[1]", "PTP XP1"], 4),
    "one of a row": (["BR[1].X=BR[1].X+1", "$BASE=BR[1]", "PTP XP1"], 4),
    "one of a row, computed": (["BR[I].X=BR[1].X+1", "$BASE=BR[1]", "PTP XP1"], 4),
    "data of the point": (["MINE.BASE_NO=2", "FDAT_ACT=MINE", "BAS(#PTP_PARAMS,100)", "PTP XP1"], 0),
    "way of turning": (["MOT.ORI_TYP=#CONSTANT", "LDAT_ACT=MOT", "$BASE=BT", "BAS(#CP_DAT)", "LIN XP1"], 4),
    "way of turning, computed": (["MOT.ORI_TYP=HOW", "LDAT_ACT=MOT", "$BASE=BT", "BAS(#CP_DAT)", "LIN XP1"], 4),
    "way of turning, handed on": (["set(MOT)", "LDAT_ACT=MOT", "$BASE=BT", "BAS(#CP_DAT)", "LIN XP1"], 4),
    "way of turning, whole": (["MOT=HOW()", "LDAT_ACT=MOT", "$BASE=BT", "BAS(#CP_DAT)", "LIN XP1"], 4),
    "nothing": (["$BASE=BT", "PTP XP1"], 0),
    "nothing, a line": (["LDAT_ACT=MOT", "$BASE=BT", "BAS(#CP_DAT)", "LIN XP1"], 0),
    "nothing, a row": (["OTHER=BR[2]", "$BASE=BR[1]", "PTP XP1"], 0),
}


@pytest.mark.parametrize("name", CHANGES_OF_A_FRAME)
@pytest.mark.parametrize("half", ["p.dat", "p.src"])
def test_krl_frames_of_the_module_that_the_program_changes_have_no_certain_value(name, half, kuka, tmp_path):
    """Wherever the change stands, and whichever half is corrected: the order of the files says nothing."""
    rows, line = CHANGES_OF_A_FRAME[name]
    frame = "{X 5,Y 0,Z 0,A 0,B 0,C 0}"
    row = [f"DECL FRAME BT={frame}", *(f"BR[{k}]={frame}" for k in (1, 2)), "DECL FRAME OTHER"]
    row += ["DECL FDAT MINE={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}", "DECL LDAT MOT={VEL 2,ORI_TYP #VAR}"]
    row += [f"DECL E6AXIS XA={AXES}"]
    texts = {
        "p.src": krl(GOOD, GOOD, *rows).replace("$BASE=", "$TOOL=$NULLFRAME\n$BASE="),
        "p.dat": "\n".join(["DEFDAT P", *row, "ENDDAT", ""]),
    }
    texts[half] = texts[half].replace("ENDDAT", f"DECL E6POS XP1={pose(kuka[0])}\nENDDAT")
    texts["p.src"] = texts["p.src"].replace("XP1", pose(kuka[0]) if half == "p.src" else "XP1")
    for file, text in texts.items():
        (tmp_path / file).write_text(text)
    done = run(tmp_path / half, texts[half], kuka)
    number = next(n for n, text in enumerate(texts[half].splitlines(), 1) if pose(kuka[0]) in text)
    if name.startswith("nothing"):
        assert number in changed(done, texts[half])
        assert not done.partly
    else:
        assert number not in changed(done, texts[half])
        assert f"line {line}" in reasons(done)[number] or not line


@pytest.mark.parametrize("switch", ["Wrist45", "Wrist46", "Wrist56"])
@pytest.mark.parametrize("first", [True, False])
def test_rapid_circles_on_two_wrist_axes_are_left(switch, first, abb, tmp_path):
    """They do not reach the orientation that is written; lines do, and so does a circle of another mode."""
    line = f"MoveL {target(abb[0])},v9,fine,tool0;"
    circle = f"MoveC {target(abb[0])},{target(abb[0])},v9,fine,tool0;"
    mode = f"CirPathMode \\{switch};"
    rows = [mode, circle, line, "SingArea \\Off;", circle] if first else [circle, line, "SetDO d,1;", circle, mode]
    text = rapid(*rows, "CirPathMode\\CirPointOri;", circle, "CirPathMode;", "SingArea \\Off;", circle)
    done = run(tmp_path / "p.mod", text, abb)
    left = [4, 7] if first else [3, 6]
    assert list(reasons(done)) == left
    assert f"CirPathMode \\{switch}" in reasons(done)[left[0]]
    assert {9, 12} <= set(changed(done, text))
    assert left[0] + 1 in changed(done, text)


@pytest.mark.parametrize("mode", ["PathFrame", "ObjectFrame", "CirPointOri"])
def test_rapid_circles_that_reach_the_orientation_are_corrected(mode, abb, tmp_path):
    text = rapid(f"CirPathMode \\{mode};", f"MoveC {target(abb[0])},{target(abb[0])},v9,fine,tool0;")
    assert not run(tmp_path / "p.mod", text, abb).partly


BEHIND_CALLS = {  # rows before and behind the call, with their moves; the lines that are not certain
    "a name": ("{A}\nNULLPUNKT\n{A}", [4]),
    "arguments": ("{A}\nNULLPUNKT(1,2)\n{A}", [4]),
    "a number": ("{A}\nL900 P2\n{A}\n{A}", [4, 5]),
    "by text": ('{A}\nCALL "NP"\n{A}', [4]),
    "by M98": ("{A}\nM98 P900\n{A}", [4]),
    "a function": ("{A}\nR1=NP(1)\n{A}", [4]),
    "no G90": ("NP\nG153 {A}", [3]),
    "offsets": ("NP\nG90\n{A}", [4]),
    "only off": ("NP\nG90 G500\n{A}", [4]),
    "before": ("G90 G500\nTRANS\nNP\nG153 {A}", [5]),
    "left out at will": ("NP\n/G90\nG153 {A}", [4]),
    "in a branch": ("NP\nIF R1==1\nG90\nG153 {A}\nELSE\nG153 {A}\nENDIF\nG153 {A}", [7, 9]),
    "called in a branch": ("IF R1==1\nNP\nENDIF\n{A}", [5]),
    "in a loop": ("LOOP\n{A}\nNP\nENDLOOP", [3]),
    "in an inner loop": ("WHILE R1==1\n{A}\nFOR R2=1 TO 3\nNP\nENDFOR\nENDWHILE", [3]),
    "by a jump back": ("AGAIN:\n{A}\nNP\nGOTOB AGAIN", [3]),
    "whole": ("{A}\nNP\nG90\nG153 {A}\nG153 {A}", []),
    "in one block": ("{A}\nNP\nG90 G153 {A}", []),
    "cleared": ("NP\nG90 G500\nTRANS\n{A}\n{A}", []),
    "in a loop, whole": ("LOOP\nG90\nG153 {A}\nNP\nENDLOOP", []),
    "behind a loop": ("LOOP\n{A}\nENDLOOP\nNP", []),
    "a jump on": ("IF R1==1 GOTOF ENDE\n{A}\nENDE:\nNP", []),
    "a switch of the machine": ("{A}\nM20\nM6\n{A}", []),
    "in the file": ("{A}\nGRIP\n{A}\nM30\nPROC GRIP\nM8\nM17", []),
}


@pytest.mark.parametrize("name", BEHIND_CALLS)
def test_moves_of_gcode_behind_a_program_that_is_not_at_hand_are_refused(name, abb, tmp_path):
    """It may leave its caller G91, a work offset or a frame; the machine does not clear them at its end."""
    rows, lines = BEHIND_CALLS[name]
    text = f"G90\n{rows}\nM30\n".replace("{A}", "G1 A1=10 A2=-20 A3=10 A4=20 A5=30 A6=5")
    (tmp_path / "p.mpf").write_text(text)
    if lines:
        with pytest.raises(InputError, match="is not in the file and may leave G91, an offset or a frame") as caught:
            compensate_file(tmp_path / "p.mpf", *abb)
        assert [int(n) for n in re.findall(r"p\.mpf:(\d+):", str(caught.value))] == lines
    else:
        done = compensate_file(tmp_path / "p.mpf", *abb)
        assert changed(done, text) == [n for n, row in enumerate(text.splitlines(), 1) if "A1=" in row]
