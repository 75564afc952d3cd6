"""URScript: joint targets of movej, in radians or as d2r(degrees)."""

import math
import re
from collections.abc import Sequence

from planner.compensation.targets import TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.statements import NUMBER, PlacedNumber
from planner.programs.languages.urscript import UrMove, parse

_TARGET = re.compile(r"movej\(\s*\[([^\]]*)\]\s*(?:,(?:(?!move[jlpc]\s*\()[^\[\]])*)?\)")
_ANGLE = re.compile(rf"\s*(?:d2r\(\s*(?P<deg>{NUMBER})\s*\)|(?P<rad>{NUMBER}(?:[eE][-+]?[0-9]+)?))\s*")
_ALLOWED = "movej([...], …) alone with plain angles or d2r() of plain degrees is corrected"
_SHIFTED = re.compile(r"\b(?:track_conveyor_\w+|path_offset_\w+)")  # motion that is added to every target
RAD_DECIMALS = 7


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program."""
    for statement in parse(text):
        if shifted := _SHIFTED.search(statement.text):
            reading.refuse(statement.line, f"{shifted[0]} found: what it adds to the targets is not known here")
        if not isinstance(statement, UrMove):
            continue
        match = _TARGET.fullmatch(statement.text)
        angles = [_ANGLE.fullmatch(a) for a in match[1].split(",")] if match else []
        if match is None or None in angles:
            reading.leave(statement.line, f"'{statement.text}' found; {_ALLOWED}")
        elif len(angles) != reading.robot.n_joints:
            reading.leave(statement.line, f"{len(angles)} angles found, the robot has {reading.robot.n_joints} joints")
        else:
            _add(reading, statement, statement.start + match.start(1), [a for a in angles if a is not None])


def _add(reading: TargetReading, statement: UrMove, start: int, angles: Sequence[re.Match[str]]) -> None:
    """Angles are in one unit throughout: those of a target in two are told and left."""
    units = {a.lastgroup for a in angles}
    if len(units) != 1:
        reading.leave(statement.line, f"'{statement.text}' mixes radians and d2r(); {_ALLOWED}")
        return
    unit = str(units.pop())
    numbers = []
    for angle in angles:
        numbers.append(PlacedNumber(float(angle[unit]), angle[unit], start + angle.start(unit)))
        start += len(angle[0]) + 1
    if unit == "deg":
        reading.add_joints(statement.line, numbers)
    elif max(abs(n.value) for n in numbers) > 4 * math.pi:
        reading.leave(statement.line, f"'{statement.text}' has angles of more than two turns: are these degrees?")
    else:
        reading.add_angles(statement.line, numbers, 1.0, RAD_DECIMALS)
