"""Kawasaki AS: what its manual says, and programs of the planner run by a small controller written from it."""

import re

import numpy as np

import tests.programs.sessions as sessions
from planner.programs.verification import write_program
from tests.programs.controllers import DialectFacts, Language

# AS reference manual: the monitor command SPEED sets the monitor speed; the instruction sets that of programs, for
# one motion where ALWAYS is not said
OVERRIDE = Language(
    motion=r"[JL]MOVE .*",
    modal={r"SPEED (\d+(?:\.\d+)?)": 100.0},
    knob=r"MC SPEED (?P<value>.*)",
    comment=r";[^\r\n]*",
    forbidden=r"\bMC\b|\bMON_SPEED\b|SPEED .*ALWAYS|SLOW_REPEAT",
)
REFUSED = [
    "SIGNAL 9",
    "CALL other",
    "LMOVE #p[1]",
    "JMOVE #p[1]",
    "DRAW 5,0,0",
    "TOOL t1",
    "POINT #p[1] = #p[2]",
    "SPEED 100 ALWAYS",
    "start_at = 5",
    "SWAIT 9",
    "IF TRUE THEN",
    "CP OFF",
    "HOME",
]
DIALECTS = {
    "kawasaki-as": DialectFacts(
        given_back=r"PULSE|SIGNAL|SPEED|ACCURACY|start_at",
        stop=r"^PAUSE$",
        wait=r"^SWAIT 7$",
        shown='TYPE "pose 3 of 4: read the gauge, then press CONTINUE"',
    )
}


def run_program(text):
    """Angles, speed and accuracy of every motion; None of an accuracy: the arm stands at a BREAK."""
    joints = dict(re.findall(r"^(#p\[\d+\]) (.*)$", text.split(".JOINTS")[1], re.MULTILINE))
    speed, accuracy, driven = None, None, []
    for line in text.split(".JOINTS")[0].splitlines():
        word, _, rest = line.partition(" ")
        if word == "SPEED":
            speed = float(rest)
        elif word == "ACCURACY":
            accuracy = float(rest)
        elif word == "JMOVE":
            driven.append([[float(cell) for cell in joints[rest].split()], speed, accuracy])
            speed = accuracy = None
        elif word == "BREAK":
            driven[-1][2] = None
    return driven


def test_a_controller_of_its_own_drives_the_plan():
    program = sessions.continuous()
    (file,) = write_program(program, "kawasaki-as", "edbb")
    driven = run_program(file.text.replace("\r\n", "\n"))
    planned = np.array([m.q_deg for m in program.moves])
    assert np.abs(np.array([angles for angles, _, _ in driven]) - planned).max() <= 0.5e-4
    assert [accuracy for _, _, accuracy in driven] == [m.blend_mm or None for m in program.moves]
    assert all(0.0 < speed <= m.axis_percent for (_, speed, _), m in zip(driven, program.moves, strict=True))
