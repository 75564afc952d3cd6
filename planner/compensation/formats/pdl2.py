"""Comau PDL2: joint targets in braces."""

import re

from planner.compensation.targets import TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.pdl2 import Pdl2Move, parse

_RELATIVE = re.compile(r"\b(RELATIVE|ABOUT|BY|AWAY|NEAR|SEG)\b", re.IGNORECASE)


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program."""
    n = reading.robot.n_joints
    for move in (statement for statement in parse(text) if isinstance(statement, Pdl2Move)):
        if not move.target.startswith("{") or _RELATIVE.search(move.how) or "{" in move.rest:
            sentence = "found; MOVE TO {…} and MOVEFLY TO {…} with plain angles are allowed"
            reading.refuse(move.line, f"'{move.text.splitlines()[0].rstrip()}' {sentence}")
        elif move.numbers is None or len(move.numbers) != n:
            reading.refuse(move.line, f"'{move.target}' found; {n} plain angles in degrees are allowed")
        else:
            reading.add_joints(move.line, move.numbers)
