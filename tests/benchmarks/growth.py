"""How the time to read a program grows with its size: ``python -m tests.benchmarks.growth [NAME …]``.

Each program is read at n and at 2n. The ratio of processor seconds is 2 where the work grows with the size, and 4 where
it grows by the square.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from planner.compensation.languages import read_targets
from planner.compensation.targets import TargetReading, ToolAndBase
from planner.kinematics.robot_reader import load_robot

ROB = "[[600,{k}.5,700],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
ANGLES = "{A1 1,A2 -90,A3 90,A4 0,A5 10,A6 0}"
POSE = "{X 600,Y 1,Z 700,A 0,B 90,C 0,S 2,T 2}"


def rapid(body):
    return "MODULE m\n" + body + "ENDMODULE\n"


def rapid_routines(n):
    """Each declares a point, drives to it and calls the next."""
    return rapid(
        "".join(
            f"CONST robtarget p{k}:={ROB.format(k=k)};\nPROC r{k}()\nMoveL p{k},v100,fine,tool0;\nr{k + 1};\nENDPROC\n"
            for k in range(n)
        )
    )


def rapid_row(n):
    """One row of points, each of which a move drives to."""
    row = ",".join(ROB.format(k=k) for k in range(n))
    moves = "".join(f"MoveL p{{{k}}},v100,fine,tool0;\n" for k in range(1, n + 1))
    return rapid(f"CONST robtarget p{{{n}}}:=[{row}];\nPROC main()\n{moves}ENDPROC\n")


def rapid_copies(n):
    """Each point is a copy of the one behind it, the last begins a chain to a tool."""
    named = "".join(
        f"PERS tooldata t{k}:=[TRUE,[[0,0,{k}],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n" for k in range(n)
    )
    chain = "".join(f"t{k}:=t{k + 1};\n" for k in range(n - 1))
    return rapid(f"{named}PROC main()\n{chain}MoveL {ROB.format(k=1)},v100,fine,t0;\nENDPROC\n")


def rapid_chain(n):
    """A chain of assignments, the nearest to a tool last, so that each round would find one more."""
    chain = "".join(f"a{k}:=a{k - 1};\n" for k in range(1, n))
    return rapid(
        f"PERS tooldata t:=[TRUE,[[0,0,1],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        f"PROC main()\n{chain}t.tframe:=a{n - 1};\nENDPROC\n"
    )


def rapid_unknown(n):
    """Every move names a tool that is nowhere declared, and hands its point on."""
    return rapid(
        "PROC main()\n"
        + "".join(f"MoveL Offs(q{k},0,0,1),v100,fine,t{k}\\WObj:=w{k};\nf{k} q{k};\nx{k}:=q{k};\n" for k in range(n))
        + "ENDPROC\n"
    )


def krl_routines(n):
    """A DEF each, which has a variable and a move."""
    return "".join(f"DEF R{k}()\nDECL INT I{k}\nPTP {ANGLES}\nR{k + 1}()\nEND\n" for k in range(n))


def krl_variables(n):
    """One DEF with n declarations and assignments."""
    return "DEF R()\n" + "".join(f"DECL INT I{k}\nI{k}=I{k - 1}+1\n" for k in range(n)) + f"PTP {ANGLES}\nEND\n"


def krl_points(n):
    """Points by name, each with a move."""
    points = "".join(
        f"DECL E6POS XP{k}={POSE}\nDECL FDAT FP{k}={{TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}}\n" for k in range(n)
    )
    moves = "".join(f"FDAT_ACT=FP{k}\nBAS(#PTP_PARAMS,50)\nPTP XP{k}\n" for k in range(n))
    return f"{points}DEF R()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{moves}END\n"


def krl_row(n):
    """Points of one row, and frames of one row that are written at a computed place."""
    points = "".join(f"P[{k}]={POSE}\n" for k in range(1, n + 1))
    moves = "".join(f"PTP P[{k}]\n" for k in range(1, n + 1))
    return f"DEF R()\n{points}{moves}END\n"


def krl_frames(n):
    """Frames with a name, and writings at a computed place of their row."""
    return (
        "".join(f"DECL FRAME F[{k}]={POSE}\n" for k in range(1, n + 1))
        + "DEF R()\n"
        + "F[I]=G\n" * n
        + f"PTP {ANGLES}\nEND\n"
    )


def krl_chain(n):
    """A chain of assignments that ends in a tool."""
    return "DEF R()\n" + "".join(f"V{k}=V{k - 1}\n" for k in range(1, n)) + f"$TOOL=V{n - 1}\nPTP {ANGLES}\nEND\n"


def krl_loops(n):
    """Nested loops and branches."""
    return "DEF R()\n" + "LOOP\nIF A THEN\n" * n + f"$TOOL=V\nPTP {ANGLES}\n" + "ENDIF\nENDLOOP\n" * n + "END\n"


def krl_lines(n):
    """Poses that follow one another without status and turn, the first of which is left."""
    line = "LIN {X 600,Y 1,Z 700,A 0,B 90,C 0}\n"
    return (
        "DEF R()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {X 1E9,Y 1,Z 700,A 0,B 90,C 0,S 2,T 2}\n" + line * n + "END\n"
    )


def krl_triggers(n):
    """Moves on whose way one long routine is called."""
    trigger = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO A() PRIO=-1\n"
    return "DEF R()\n" + f"{trigger}PTP {ANGLES}\n" * n + "END\nDEF A()\n" + "I=1\n" * n + "END\n"


def pdl2_moves(n):
    """Routines with a move each."""
    return (
        "PROGRAM p\n"
        + "".join(f"ROUTINE r{k}\nBEGIN\nMOVE TO {{1,2,-90,4,5,6}}\nEND r{k}\n" for k in range(n))
        + "END p\n"
    )


def fanuc_points(n):
    """Moves to n positions."""
    moves = "".join(f"{k}:J P[{k}] 10% FINE ;\n" for k in range(1, n + 1))
    points = "".join(
        f"P[{k}]{{\n GP1:\n UF : 0, UT : 1,\n J1= 1.0 deg, J2= 2.0 deg, J3= 3.0 deg,\n"
        " J4= 4.0 deg, J5= 5.0 deg, J6= 6.0 deg\n};\n"
        for k in range(1, n + 1)
    )
    return f"/PROG P\n/MN\n{moves}/POS\n{points}/END\n"


def fanuc_other(n):
    """Lines between the positions that are none, and uses of positions that are not there."""
    moves = "".join(f"{k}:J P[{k}] 10% FINE Offset,PR[1] ;\n" for k in range(1, n + 1))
    return f"/PROG P\n/MN\n{moves}/POS\n" + "what\n" * n + "/END\n"


def gcode_blocks(n):
    """Blocks of moves, labels, loops and calls."""
    move = "G1 A1=1 A2=-90 A3=90 A4=0 A5=10 A6=0\n"
    return "G90 G500\n" + move + "".join(f"LOOP\nSUB{k}\n{move}ENDLOOP\n" for k in range(n)) + "M30\n"


def gcode_nested(n):
    """Loops within loops, each with a call."""
    move = "G1 A1=1 A2=-90 A3=90 A4=0 A5=10 A6=0\n"
    return "G90 G500\n" + f"LOOP\nCALLED\n{move}" * n + "ENDLOOP\n" * n + "M30\n"


def gcode_programs(n):
    """Programs of one file, each behind a percent sign."""
    return "%\nG1 A1=1 A2=-90 A3=90 A4=0 A5=10 A6=0\nM30\n" * n


def gcode_definitions(n):
    """Variables, and words beside moves."""
    return "".join(f"DEF REAL V{k}\nV{k}=1\n" for k in range(n)) + "G1 A1=1 A2=-90 A3=90 A4=0 A5=10 A6=0\nM30\n"


def urscript_moves(n):
    """Variables with six angles, each with a move."""
    return (
        "def p():\n"
        + "".join(f"  q{k} = [0.1,-1.5,1.5,0,1,0]\n  movej(q{k}, a=1, v=1)\n  f{k}(q{k})\n" for k in range(n))
        + "end\n"
    )


def table(n):
    """Rows of joint angles."""
    return "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n" + "10.5,-80,90,4,55,60\n" * n


PROGRAMS: dict[str, tuple[str, Callable[[int], str], int]] = {
    "RAPID routines": ("rapid", rapid_routines, 8_000),
    "RAPID one row": ("rapid", rapid_row, 2_000),
    "RAPID copies": ("rapid", rapid_copies, 4_000),
    "RAPID chain": ("rapid", rapid_chain, 4_000),
    "RAPID unknown": ("rapid", rapid_unknown, 4_000),
    "KRL routines": ("krl", krl_routines, 8_000),
    "KRL variables": ("krl", krl_variables, 8_000),
    "KRL points": ("krl", krl_points, 4_000),
    "KRL one row": ("krl", krl_row, 4_000),
    "KRL frames": ("krl", krl_frames, 2_000),
    "KRL chain": ("krl", krl_chain, 4_000),
    "KRL loops": ("krl", krl_loops, 8_000),
    "KRL triggers": ("krl", krl_triggers, 2_000),
    "KRL lines": ("krl", krl_lines, 4_000),
    "PDL2 moves": ("pdl2", pdl2_moves, 8_000),
    "FANUC positions": ("fanuc-tp", fanuc_points, 8_000),
    "FANUC other lines": ("fanuc-tp", fanuc_other, 8_000),
    "G-code blocks": ("sinumerik", gcode_blocks, 4_000),
    "G-code nested": ("sinumerik", gcode_nested, 4_000),
    "G-code programs": ("sinumerik", gcode_programs, 8_000),
    "G-code definitions": ("sinumerik", gcode_definitions, 8_000),
    "URScript moves": ("urscript", urscript_moves, 8_000),
    "table": ("csv", table, 20_000),
}


def read(name, size, robot):
    """Read a program of a size, and return the reading."""
    dialect, make, _ = PROGRAMS[name]
    reading = TargetReading(name, robot, ToolAndBase(np.eye(4), np.eye(4)))
    read_targets(dialect, make(size), reading)
    reading.take_targets()
    return reading


def seconds(name, size, robot):
    """Processor seconds of one reading."""
    begun = time.process_time()
    read(name, size, robot)
    return time.process_time() - begun


def main():
    robot = load_robot("kuka-kr6-r700")
    for name in sys.argv[1:] or PROGRAMS:
        size = PROGRAMS[name][2]
        once, twice = (seconds(name, n, robot) for n in (size, 2 * size))
        print(f"{name:20} n = {size:6} {once:7.2f} s, 2n {twice:7.2f} s, ratio {twice / once:.2f}", flush=True)


if __name__ == "__main__":
    main()
