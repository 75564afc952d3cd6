"""Comau PDL2: joint targets in braces."""

import re

from planner.compensation.service_points import SENTENCE, is_service_name
from planner.compensation.targets import TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.pdl2 import Pdl2Move, parse
from planner.programs.languages.statements import Routine

_RELATIVE = re.compile(r"\b(RELATIVE|ABOUT|BY|AWAY|NEAR|SEG)\b", re.IGNORECASE)
_ALLOWED = "MOVE TO {…} and MOVEFLY TO {…} with plain angles are corrected"


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program."""
    routine, n = "", reading.robot.n_joints
    for statement in parse(text):
        if isinstance(statement, Routine):
            routine = statement.name
        if not isinstance(statement, Pdl2Move):
            continue
        line, said = statement.line, statement.text.splitlines()[0].rstrip()
        if is_service_name(routine) or is_service_name(statement.target):
            reading.leave(line, f"'{said}' {SENTENCE}")
        elif not statement.target.startswith("{") or _RELATIVE.search(statement.how) or "{" in statement.rest:
            reading.leave(line, f"'{said}' found; {_ALLOWED}")
        elif statement.numbers is None or len(statement.numbers) != n:
            reading.leave(line, f"'{statement.target}' found; {n} plain angles in degrees are corrected")
        else:
            reading.add_joints(line, statement.numbers)
