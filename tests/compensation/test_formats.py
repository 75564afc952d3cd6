"""Every language keeps its text: nothing changed gives the same bytes back, a known change gives known numbers."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.common.errors import InputError, NoSolutionError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.languages import corrected_dialects
from planner.kinematics.robot_reader import load_robot
from planner.programs.verification import write_program
from tests.compensation.robots import (
    BentRobot,
    bent,
    exact,
    half_pulse_deg,
    regular_angles,
    unlimited,
)
from tests.programs.languages import targets_first
from tests.programs.reading import read_back

HALF = np.radians(0.5)
NAMES = [d.name for d in corrected_dialects()]  # a pose list is corrected as a table of targets
HEAD = "# plan: ö; 1,2\nname;q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg\n"
CSV = HEAD + "a; 10.5;-20;30.25;\t4.0;55;6e1\n\nb,c;1;2;3;4;35;6\n"


def shifted(robot, joint=3, angle=HALF):
    """A robot whose joint stands further by ``angle`` than its controller believes."""
    delta = np.array(
        [angle * robot.coupling_matrix[joint, joint] if t.joint == joint else 0.0 for t in robot.transforms]
    )
    return BentRobot(robot, delta)


@pytest.fixture(scope="module")
def robot():
    return unlimited(load_robot("kuka-kr6-r700"))


def programs(folder, name):
    files = targets_first(name, write_program(replace(sessions.mixed(6, 6), robot="kuka-kr6-r700"), name, "session"))
    for file in files:
        (folder / file.name).write_bytes(file.text.encode(file.encoding))
    return files, folder / files[0].name


@pytest.mark.parametrize("name", NAMES)
def test_nothing_changed_gives_the_same_bytes_back(name, robot, tmp_path):
    files, path = programs(tmp_path, name)
    done = compensate_file(path, robot, exact(robot))
    assert done.text.encode(done.encoding) == path.read_bytes()
    assert done.report.joint_targets == len(read_back(name, files).joint_path_deg)


@pytest.mark.parametrize("name", NAMES)
def test_a_known_change_gives_known_numbers(name, robot, tmp_path):
    files, path = programs(tmp_path, name)
    done = compensate_file(path, robot, shifted(robot))
    before = read_back(name, files)
    after = read_back(name, [replace(files[0], text=done.text), *files[1:]])
    expected = before.joint_path_deg - 0.5 * np.eye(6)[3]
    assert (np.abs(after.joint_path_deg - expected) <= 1.1e-5 + 2.0 * half_pulse_deg(name)).all()
    assert [(m.blend, m.speed) for m in after.moves] == [(m.blend, m.speed) for m in before.moves]
    assert after.dwells_s == before.dwells_s
    remarks = [[line for line in f.text.splitlines() if "pose" in line.lower() and "1" in line] for f in files]
    assert any(remarks)
    assert all(line in done.text for line in remarks[0] if "=" not in line)


@pytest.mark.parametrize("name", NAMES)
def test_the_loop_closes_as_printed(name, robot, tmp_path):
    _, path = programs(tmp_path, name)
    _, real = bent("kuka-kr6-r700", size=1e-4, give=2e-4)
    report = compensate_file(path, robot, real).report
    printed = np.deg2rad(half_pulse_deg(name)).sum()
    assert report.left_m < 1e-6 + printed  # every axis rounded, a metre from it
    assert report.left_rad < 1e-6 + printed
    assert report.shift_max_m > 1e-4


def test_a_table_keeps_what_is_not_a_target(robot, tmp_path):
    path = tmp_path / "targets.csv"
    path.write_bytes(CSV.replace("\n", "\r\n").encode("latin-1"))
    done = compensate_file(path, robot, exact(robot))
    assert done.text.encode(done.encoding) == b"# axes_of: model\r\n" + path.read_bytes()
    moved = compensate_file(path, robot, shifted(robot))
    assert "\r\na; 10.5;-20;30.25;\t3.500000;55;6e1\r\n\r\n" in moved.text
    assert moved.encoding == "latin-1"


def test_rows_that_only_wait_are_kept_without_a_word(robot, tmp_path):
    path = tmp_path / "poses.csv"
    joints = ",".join(f"q{j}_deg" for j in range(1, 7))
    path.write_text(f'kind,{joints},text\nmove,1,2,3,4,35,6,\npause,,,,,,,"mount the bar, then start"\n')
    done = compensate_file(path, robot, shifted(robot))
    assert not done.report.kept
    assert 'move,1,2,3,3.500000,35,6,\npause,,,,,,,"mount the bar, then start"\n' in done.text


def krl(*lines):
    return "\n".join(["DEF P ( )", *lines, "END", ""])


def test_krl_axes_declared_by_name_and_in_columns(robot, tmp_path):
    path = tmp_path / "p.dat"
    path.write_text(
        "DEFDAT P PUBLIC\n"
        "DECL E6AXIS XA={A1 10,A2   -90.0,A3    90.0,A4     8.5,A5 45,A6 0,E1 77.0} ; {A1 10}\n"
        "DECL GLOBAL ROW LOG[1]\nLOG[1]={POSE 1,AX {A1 0.0,A2 0.0,A3 0.0,A4 0.0,A5 0.0,A6 0.0}}\nENDDAT\n"
    )
    text = compensate_file(path, robot, shifted(robot)).text
    assert "DECL E6AXIS XA={A1 10,A2   -90.0,A3    90.0,A4 8.00000,A5 45,A6 0,E1 77.0} ; {A1 10}\n" in text
    assert "LOG[1]={POSE 1,AX {A1 0.0,A2 0.0,A3 0.0,A4 0.0,A5 0.0,A6 0.0}}" in text


def test_blocks_that_leave_axes_out_get_them_all(robot, tmp_path):
    path = tmp_path / "p.nc"
    path.write_text("%P\nG90\nN10 G93 G1 A1=10 A2=-80 A3=90 A4=5 A5=40 A6=6 F20 (A1=3)\nN20 A5=50 F30\nM30\n")
    _, real = bent("kuka-kr6-r700")
    text = compensate_file(path, robot, real).text
    whole = tmp_path / "whole.csv"
    head = ",".join(f"q{i}_deg" for i in range(1, 7))
    whole.write_text(f"{head}\n10,-80,90,5,40,6\n10,-80,90,5,50,6\n")
    rows = [line.split(",") for line in compensate_file(whole, robot, real).text.splitlines()[2:]]
    second = dict(w.split("=") for w in text.splitlines()[3].split() if "=" in w)
    np.testing.assert_allclose([float(second[f"A{i}"]) for i in range(1, 7)], np.array(rows[1], float), atol=6e-6)
    assert text.splitlines()[3].startswith("N20 A5=")
    assert text.splitlines()[3].endswith(" F30")
    assert text.splitlines()[2].endswith(" F20 (A1=3)")


def test_a_block_that_is_left_does_not_take_corrected_angles_from_the_one_before(robot, tmp_path):
    """A6 stands at its limit in the second block: it keeps the angles that it had, those that it left out too."""
    path = tmp_path / "p.nc"
    path.write_text("G90\nG93 G1 A1=10 A2=-80 A3=90 A4=5 A5=40 A6=6 F20\nA6=350\nA6=6\nM30\n")
    narrow = load_robot("kuka-kr6-r700")
    done = compensate_file(path, narrow, shifted(narrow, 5, -HALF))
    assert [line for line, _ in done.report.kept] == [3]
    blocks = [dict(w.split("=") for w in row.split() if "=" in w) for row in done.text.splitlines()]
    angles = [[float(b[f"A{i}"]) for i in range(1, 7)] for b in blocks if "A6" in b]
    np.testing.assert_allclose(angles[0], [10, -80, 90, 5, 40, 6.5], atol=1e-5)
    np.testing.assert_allclose(angles[1], [10, -80, 90, 5, 40, 350], atol=1e-9)
    np.testing.assert_allclose(angles[2], angles[0], atol=1e-9)


REFUSED = {
    "relative.src": (krl("PTP_REL {A1 10}"), 2, "moves relative"),
    "operator.src": (krl("PTP XP1:{X 10,Y 0,Z 0,A 0,B 0,C 0}"), 2, "a position in braces"),
    "expression.src": (krl("PTP {A1 10+W,A2 0,A3 0,A4 0,A5 0,A6 0}"), 2, "plain numbers are allowed"),
    "computed.src": (krl("XP1=$AXIS_ACT", "PTP XP1"), 3, "computed while the program runs"),
    "partial.src": (krl("PTP {A1 10}"), 2, "A1, A2, A3, A4, A5, A6 are needed"),
    "frames.src": (krl("LIN {X 1,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}"), 2, "does not say the tool and base"),
    "initmov.src": (
        krl("$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", "BAS(#INITMOV,0)", "LIN {X 1,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}"),
        5,
        "does not say the tool and base",
    ),
    "branch.src": (
        krl("$BASE=$NULLFRAME", "IF A THEN", "$TOOL=$NULLFRAME", "ENDIF", "PTP {X 1,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}"),
        6,
        "does not say the tool",
    ),
    "accurate.src": (
        krl("$BASE=$NULLFRAME", "$TOOL=$NULLFRAME", "PTP {X 400,Y 0,Z 400,A 0,B 90,C 0,S 18,T 2}"),
        4,
        "would count twice",
    ),
    "offset.mod": ("MODULE M\nPROC main()\n  MoveL Offs(p1,0,0,5), v10, fine, tool0;\nENDPROC\nENDMODULE\n", 3, "Offs"),
    "tool.mod": (
        "MODULE M\nPROC main()\n"
        "MoveL [[400,0,400],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,tGrip;\nENDPROC\n",
        3,
        "tGrip is not declared with plain numbers",
    ),
    "computed.mod": (
        "MODULE M\nVAR jointtarget j1:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nPROC main()\n"
        "j1.robax.rax_1:=5;\nMoveAbsJ j1,v1,z1,tool0;\nENDPROC\n",
        5,
        "computed while the program runs",
    ),
    "incremental.nc": ("G91\nG1 A1=1 A2=2 A3=3 A4=4 A5=5 A6=6\nM30\n", 1, "relative angles"),
    "circle.nc": ("G2 A1=1 A2=2 A3=3 A4=4 A5=5 A6=6\nM30\n", 1, "no joint move"),
    "cartesian.nc": ("G1 X10 Y20 F30\nM30\n", 1, "the word X found"),
    "variable.MPF": ("G90\nG1 A1=R1 A2=2 A3=3 A4=4 A5=5 A6=6\nM30\n", 2, "computes or moves axis A1"),
    "call.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nL100\nG0 A1=11\nM30\n", 3, "A2, A3, A4, A5, A6 is not known"),
    "extcall.MPF": ('G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nEXTCALL("X")\nG0 A1=11\n', 3, "is not known here"),
    "plc.ngc": ("G53 G0 X1 Y-20 Z3 A4 B5 C6\nT1 M6\nG53 G0 X2\nM2\n", 3, "Y, Z, A, B, C is not known"),
    "label.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nAGAIN:\nG0 A1=11\nGOTOB AGAIN\n", 3, "is not known here"),
    "number.MPF": ("N1 G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nN2 G0 A1=11\nGOTOB N2\n", 2, "is not known here"),
    "skipped.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n/G0 A1=50\nG0 A2=-21\n", 3, "is not known here"),
    "posa.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nPOSA[A1]=50\n", 2, "computes or moves axis A1"),
    "arc.MPF": (
        "%_N_MAIN_MPF\nG153 G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nUP1\nM30\n%_N_UP1_SPF\nG153 G1 A1=12 F100\nM17\n",
        6,
        "A2, A3, A4, A5, A6 is not known",
    ),
    "two.nc": ("G1 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nM30\nG1 A1=12\nM30\n", 3, "A2, A3, A4, A5, A6 is not known"),
    "endless.nc": ("N10 G1 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nN20 G1 A1=12\nM99 P20\n", 2, "is not known here"),
    "string.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nN20 G0 A1=12\nGOTOB ZIEL\n", 2, "is not known here"),
    "modal call.MPF": ("MCALL GRIP\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nG0 A1=12\nMCALL\n", 3, "is not known here"),
    "tool.MPF": ("T1 D1\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "D1 found: a tool offset"),
    "group offset.nc": ("G159=3\nG1 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "a tool offset"),
    "world.ngc": ("M429\nG53 G0 X1 Y-20 Z3 A4 B5 C6\nM2\n", 1, "it changes what the words of the axes mean"),
    "any axis.MPF": ("AX[AXN]=20\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the axes"),
    "belt.script": (
        "def p():\n track_conveyor_linear(p[1,0,0,0,0,0],500)\n movej([0.1,-1,1,0.1,0.5,0])\nend\n",
        2,
        "track_conveyor_linear found",
    ),
    "offset.MPF": ("G54\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "a work offset"),
    "length.ngc": ("G43 H1\nG53 G0 X1 Y-20 Z3 A4 B5 C6\n", 1, "what it does to the axes is not known"),
    "blank.ngc": ("G53 G0 X1 Y-20 Z3 A4 B5 C6\nG53 G0 X 1 1\n", 2, "computes or moves axis X"),
    "letter.ngc": ("G53 G0 X1 Y-20 Z3 A4 B5 C6 O9\n", 1, "the word O found"),
    "index.MPF": ("G0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\nG0 A[1]=5\n", 2, "is no row of words"),
    "group.MPF": ("G[8]=2\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the axes is not known"),
    "frame.MPF": ("$P_IFRAME=$P_UIFR[2]\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the axes"),
    "macro.MPF": ("DEFINE FAST AS MYMOVE\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the axes"),
    "action.MPF": ("ID=1 WHEN $A_IN[1]==1 DO M8\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the"),
    "overlaid.MPF": ("$AA_OFF=3\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "what it does to the axes"),
    "turned.MPF": ("TRAORI\nG0 A1=1 A2=-20 A3=30 A4=4 A5=5 A6=6\n", 1, "TRAORI found"),
    "computed.ngc": ("G[20]\nG53 G0 X1 Y-20 Z3 A4 B5 C6\n", 1, "what it does to the axes is not known"),
    "second.ngc": ("G55\nG0 X1 Y-20 Z3 A4 B5 C6\n", 2, "no G53 after G55"),
    "written.ngc": ("#5221=30\nG0 X1 Y-20 Z3 A4 B5 C6\n", 1, "#5221="),
    "both.ngc": ("G53 G0 X1 Y-20 Z3 A4 B5 C6\nM8\nG0 X2\n", 3, "no G53: the work offset is not known"),
    "modal.nc": ("G1 A1=1 A2=2\nM30\n", 1, "A3, A4, A5, A6 is not known"),
    "loop.ngc": (
        "G90\nG53 G1 X1 Y2 Z3 A4 B5 C6 F1\no1 repeat [3]\nG53 G1 X5\no1 endrepeat\nM2\n",
        4,
        "Y, Z, A, B, C is not known",
    ),
    "expression.ngc": ("G53 G1 X[1+2] Y2 Z3 A4 B5 C6\nM2\n", 1, "computes or moves axis X"),
    "inches.ngc": ("G20\nG53 G1 X1 Y2 Z3 A4 B5 C6\nM2\n", 1, "inches"),
    "named.pdl": ("PROGRAM p\nBEGIN\n  MOVE TO pnt1\nEND p\n", 3, "plain angles are corrected"),
    "cartesian.pdl": (
        "PROGRAM p\nBEGIN\n  MOVE TO POS(1, 2, 3, 4, 5, 6, '')\nEND p\n",
        3,
        "plain angles are corrected",
    ),
    "letters.csv": ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3,x,5,6\n", 2, "'x' found in column 4"),
    "short.csv": ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3\n", 2, "3 cells found"),
    "columns.csv": ("q1_deg,q2_deg\n1,2\n", 1, "q1_deg … q6_deg"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_understood_is_refused_with_its_line(name, robot, tmp_path):
    text, line, words = REFUSED[name]
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        compensate_file(path, robot, exact(robot), dialect="linuxcnc" if name.endswith(".ngc") else None)
    assert caught.value.exit_code == 2
    found = [sentence for sentence in str(caught.value).splitlines() if sentence.startswith(f"{name}:{line}:")]
    assert any(words in sentence for sentence in found), str(caught.value)


def test_every_wrong_line_is_named(robot, tmp_path):
    path = tmp_path / "many.src"
    path.write_text(krl(*["PTP_REL {A1 1}"] * 30))
    with pytest.raises(InputError) as caught:
        compensate_file(path, robot, exact(robot))
    assert str(caught.value).count("\nmany.src:") == 21
    assert "and 10 more lines" in str(caught.value)


def test_unknown_and_empty_files_are_refused(robot, tmp_path):
    (tmp_path / "a.xyz").write_text("hello")
    with pytest.raises(InputError, match=r"neither the suffix '\.xyz' nor the content"):
        compensate_file(tmp_path / "a.xyz", robot, exact(robot))
    (tmp_path / "b.src").write_text(krl("PTP XHOME"))
    with pytest.raises(InputError, match=r"holds no target .*\n.*:2: XHOME is declared elsewhere"):
        compensate_file(tmp_path / "b.src", robot, exact(robot))
    with pytest.raises(InputError, match="cannot be read"):
        compensate_file(tmp_path / "none.src", robot, exact(robot))
    (tmp_path / "c.src").write_bytes(b"D\0E\0F\0")
    with pytest.raises(InputError, match="zero bytes"):
        compensate_file(tmp_path / "c.src", robot, exact(robot))
    (tmp_path / "d.src").write_text(krl("PTP {A1 " + "0" * 300_000 + "}"))
    with pytest.raises(InputError, match=r"d\.src:2: the line has 3000\d\d signs; at most"):
        compensate_file(tmp_path / "d.src", robot, exact(robot))


@pytest.mark.parametrize(
    ("name", "run"),
    [("a.ngc", "("), ("a.src", "PTP" + " " * 500), ("a.mod", "a" + " " * 500), ("a.xyz", "\n"), ("a.mpf", "X[")],
)
def test_runs_of_one_sign_are_read_once(robot, tmp_path, name, run):
    """None of them is tried from each of its signs: 19 kB would take minutes."""
    (tmp_path / name).write_text(run * (19_000 // len(run)))
    start = time.process_time()
    with pytest.raises(InputError):
        compensate_file(tmp_path / name, robot, exact(robot))
    assert time.process_time() - start < 20.0  # of the processor, however busy the machine is: most take milliseconds


def test_targets_without_a_solution_are_named_or_kept(tmp_path):
    robot, real = bent("kuka-kr6-r700")
    home = "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}"
    edge = "PTP {A1 10,A2 -80,A3 100,A4 20,A5 40,A6 350}"
    good = [
        "PTP {" + ",".join(f"A{i} {v:.3f}" for i, v in enumerate(np.degrees(q), 1)) + "}"
        for q in regular_angles(robot, 3)
    ]
    path = tmp_path / "p.src"
    path.write_text(krl(home, *good, edge))
    over = shifted(robot, 5, -HALF)
    with pytest.raises(NoSolutionError, match=r"p\.src:6: joint 6 would have to stand at 350\.5000°; -350 … 350° are"):
        compensate_file(path, robot, over, strict=True)
    path.write_text(krl(home, *good, good[0]))
    with pytest.raises(NoSolutionError, match=r"1 of 5 targets[^\n]*\np\.src:2: .*singular") as caught:
        compensate_file(path, robot, real, strict=True)
    assert caught.value.exit_code == 3
    kept = compensate_file(path, robot, real)
    assert home in kept.text
    assert not any(line in kept.text for line in good)
    assert [line for line, _ in kept.report.kept] == [2]


def without_head(text):
    """The text without the comment lines that were put in at its head."""
    lines = text.splitlines(keepends=True)
    first = next((k for k, line in enumerate(lines) if "Compensated in part" in line), 0)
    last = first
    while last < len(lines) and re.match(r"[;!#] \S", lines[last]) and first:
        last += 1
    return "".join(lines[:first] + lines[last:])


TAUGHT = """\
&ACCESS RVP
DEF PART ( )
;FOLD INI;%{{PE}}
  BAS (#INITMOV,0 )
;ENDFOLD (INI)
;FOLD PTP P1 Vel=100 % PDAT1 Tool[1]:grip Base[0];%{{PE}}%R 8.3,%MKUKATPBASIS
$BWDSTART=FALSE
PDAT_ACT=PPDAT1
FDAT_ACT=FP1
BAS(#PTP_PARAMS,100)
PTP XP1
;ENDFOLD
PTP {joints} C_PTP ; {{A1 0}}
LIN XP2 C_DIS
PTP $AXIS_ACT
END
"""


def test_points_by_name_are_left_to_the_file_that_declares_them(robot, tmp_path):
    path = tmp_path / "part.src"
    path.write_text(TAUGHT.format(joints="{A1 10,A2 -80,A3 90,A4 5,A5 40,A6 6,E1 0}"))
    path.with_suffix(".dat").write_text("DEFDAT PART\nENDDAT\n")
    done = compensate_file(path, robot, shifted(robot))
    assert without_head(done.text) == TAUGHT.format(joints="{A1 10,A2 -80,A3 90,A4 4.50000,A5 40,A6 6,E1 0}")
    assert [(line, note.split()[0]) for line, note in done.report.kept] == [(11, "XP1"), (14, "XP2")]
    head = len(done.text.splitlines()) - len(TAUGHT.splitlines())
    assert f"; Corrected lines: {13 + head}." in done.text
    assert f"; Left as written, lines {11 + head}: XP1" in done.text


def test_rapid_targets_by_name_and_in_place(tmp_path):
    robot = unlimited(load_robot("abb-irb120"))
    text = (
        "MODULE M\n  ! p1 := 3; a remark\n"
        "  LOCAL CONST jointtarget jHome:=[[10,20,30,{},50,60],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        "  PROC main()\n    MoveAbsJ jHome \\NoEOffs, v100, fine, tool0;\n"
        "    MoveAbsJ [[1, 2,\n      3, {}, 50, 6], [9E9,9E9,9E9,9E9,9E9,9E9]], v100, z10, tool0 \\WObj:=wobj0;\n"
        '    TPWrite "MoveAbsJ [[1,2,3,4,5,6],[0,0,0,0,0,0]]";\n    MoveAbsJ jOther, v100, fine, tool0;\n'
        "  ENDPROC\nENDMODULE\n"
    )
    path = tmp_path / "m.mod"
    path.write_text(text.format("40", "4.0"))
    done = compensate_file(path, robot, shifted(robot))
    assert without_head(done.text) == text.format("39.50000", "3.50000")
    assert [line for line, _ in done.report.kept] == [9]


def test_the_summary_says_what_was_left(tmp_path):
    robot, real = bent("kuka-kr6-r700")
    path = tmp_path / "p.src"
    path.write_text(
        krl("PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}", "PTP {A1 10,A2 -80,A3 90,A4 5,A5 40,A6 6}", "PTP XP9")
    )
    path.with_suffix(".dat").write_text("DEFDAT P\nENDDAT\n")
    done = compensate_file(path, robot, real)
    assert "1 joint target and 0 poses corrected" in done.summary
    assert "left as it was: p.src:2:" in done.summary
    assert "p.src:4: XP9 is declared elsewhere" in done.summary


def test_a_switch_of_the_machine_in_between_is_told(robot, tmp_path):
    path, row = tmp_path / "p.MPF", "G0 A1=1 A2=-80 A3=90 A4=4 A5=20 A6=6\n"
    path.write_text(f"{row}R1=5\n{row}MSG()\n{row}M6\n{row}{row}M30\n")
    done = compensate_file(path, robot, exact(robot), dialect="sinumerik")
    assert [line for line, _ in done.report.notes] == [7, 1]
    assert "after what line 6 calls" in done.summary
    assert "no G500, G53 or G153: the work offset is taken as zero" in done.summary


@pytest.mark.parametrize("number", ["1e1", "1e400"])
def test_an_exponent_in_gcode_is_refused(tmp_path, number):
    """The digits before it would be corrected, and the power of ten would stay."""
    path = tmp_path / "p.nc"
    path.write_text(f"%\nG90\nG0 A1={number} A2=-80 A3=90 A4=5 A5=20 A6=0\nM30\n")
    with pytest.raises(InputError, match=r"p\.nc:3: the word E found"):
        compensate_file(path, load_robot("kuka-kr6-r700"), exact(load_robot("kuka-kr6-r700")), dialect="din66025")


@pytest.mark.parametrize("number", ["1e400", "1e200"])
def test_a_number_beyond_any_robot_is_left_and_said(tmp_path, number):
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "p.src"
    path.write_text(
        f"DEF p()\nPTP {{A1 {number},A2 -80,A3 90,A4 5,A5 20,A6 0}}\nPTP {{A1 1,A2 -80,A3 90,A4 5,A5 20,A6 0}}\nEND\n"
    )
    done = compensate_file(path, robot, exact(robot))
    assert [line for line, _ in done.report.kept] == [2]
    assert done.report.joint_targets == 1
