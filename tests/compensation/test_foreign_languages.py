"""Programs in languages that are not read are refused by their name, and nothing is written."""

import pytest

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.languages import corrected_dialects
from tests.compensation.robots import bent

PROGRAMS = {  # name of a file, its text, and the language that the refusal names; as the makers' manuals write them
    "karel": (
        "pick.kl",
        "PROGRAM pick\n%NOLOCKGROUP\nVAR\n  p1 : XYZWPR\nBEGIN\n  $MOTYPE = LINEAR\n  MOVE TO p1\nEND pick\n",
        "Karel (FANUC)",
    ),
    "Karel as PDL2": (
        "pick.pdl",
        "PROGRAM pick\nVAR\n  p1 : XYZWPR\nBEGIN\n  p1 = CURPOS(0, 0)\n  MOVE TO p1\n  DOUT[1] = ON\nEND pick\n",
        "Karel (FANUC)",
    ),
    "V+": ("pick.v2", ".PROGRAM pick()\n  SPEED 50\n  MOVE #p1\n  MOVES p2\n.END\n", "V+ (Adept, Stäubli)"),
    "DRL": ("pick.drl", "movej(posj(0,0,90,0,90,0), vel=60, acc=60)\nmovel(posx(400,0,300,0,180,0))\n", "DRL (Doosan)"),
    "DRL as Python": ("pick.py", "p = posj(0,0,90,0,90,0)\namovej(p, v=60, a=60)\n", "DRL (Doosan)"),
    "MELFA": (
        "1.prg",
        "1 Servo On\n2 Ovrd 30\n3 Mov P1, -50\n4 Mvs P1\n6 End\nP1=(+400.00,+0.00,+300.00,+180,+0.00,+180)(7,0)\n",
        "MELFA-BASIC (Mitsubishi)",
    ),
    "xArm": (
        "pick.py",
        "from xarm.wrapper import XArmAPI\narm = XArmAPI('10.0.0.1')\narm.set_servo_angle(angle=[0, 0, 0, 0, 0, 0])\n",
        "Python for xArm (UFACTORY)",
    ),
    "PacScript": ("pick.pcs", "Sub Main\n  TakeArm Keep = 0\n  Move P, @P P1, S = 50\nEnd Sub\n", "PacScript (Denso)"),
    "Nachi": ("NRA.001", "MOVEX A=1,AC=0,SM=0,M1J,P,(0,90,-90,0,0,0),R= 10.0,H=1,MS\nEND\n", "SLIM (Nachi)"),
    "Hyundai": (
        "0001.JOB",
        "Hyundai Robot Job File; { version: 1.6 }\nS1   MOVE P,S=60%,A=0,T=1\nEND\n",
        "HRBASIC (Hyundai)",
    ),
    "Hyundai without its head": (
        "0001.JOB",
        "S1   MOVE P,S=60%,A=0,T=1\nS2   MOVE L,S=100mm/sec,A=0,T=1\nEND\n",
        "HRBASIC",
    ),
    "HIWIN": ("p.hrb", "PTP P1 CONT=100% Vel=100% Acc=50% TOOL[0] BASE[0]\n", "HRSS (HIWIN)"),
    "SPEL+": ("main.prg", "Function main\n  Motor On\n  Go P1\n  Jump P2\nFend\n", "SPEL+ (Epson)"),
    "binary TP": ("PICK.TP", "\0\1\2PICK\0", "a binary TP program (FANUC)"),
    "modules of RAPID": (
        "a.pgf",
        "<Program>\n  <Module>a.mod</Module>\n</Program>\n",
        "list of modules of a RAPID program",
    ),
    "Sunrise": (
        "Pick.java",
        "import com.kuka.roboticsAPI.applicationModel.RoboticsAPIApplication;\n",
        "Java for Sunrise (KUKA)",
    ),
    "Python": ("move.txt", "import numpy as np\n\ndef main():\n    robot.movej([0, 0, 0, 0, 0, 0])\n", "is Python"),
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_in_other_languages_are_refused_by_their_name(name, tmp_path):
    file, text, language = PROGRAMS[name]
    (tmp_path / file).write_text(text, encoding="utf-8")
    robot, real = bent("kuka-kr6-r700")
    with pytest.raises(InputError) as refused:
        compensate_file(tmp_path / file, robot, real)
    assert language in str(refused.value)
    assert all(d.language in str(refused.value) for d in corrected_dialects())
