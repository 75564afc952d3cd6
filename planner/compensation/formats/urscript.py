"""URScript: joint targets of movej, in radians or as d2r(degrees)."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from planner.common.units import Array
from planner.compensation.targets import TargetReading
from planner.kinematics.geometry import pose
from planner.programs.dialect import Dialect
from planner.programs.languages.statements import NUMBER, PlacedNumber, Statement
from planner.programs.languages.urscript import UrMove, parse

_TARGET = re.compile(r"movej\(\s*\[([^\]]*)\]\s*(?:,(?:(?!move[jlpc]\s*\()[^\[\]])*)?\)")
_ANGLE = re.compile(rf"\s*(?:d2r\(\s*(?P<deg>{NUMBER})\s*\)|(?P<rad>{NUMBER}(?:[eE][-+]?[0-9]+)?))\s*")
_ALLOWED = "movej([...], …) alone with plain angles or d2r() of plain degrees is corrected"
_NAMED = re.compile(r"(?:(?:global|local)\s+)?(?P<name>[A-Za-z_]\w*)\s*=\s*\[(?P<angles>[^\[\]]*)\]")
_MOVE_BY_NAME = re.compile(r"movej\(\s*(?P<name>[A-Za-z_]\w*)\s*(?:,(?:(?!move[jlpc]\s*\()[^\[\]])*)?\)")
_NO_TARGET = re.compile(r"(?:set_|get_|force_mode|zero_|tool_|def |thread )")  # tools, loads, forces
_LISTED = re.compile(r"p?\[(?P<cells>[^\[\]]*)\]")
_SETS_TOOL = re.compile(r"\bset_tcp\s*\(")
_TOOL = re.compile(r"set_tcp\(\s*p\[([^\[\]]*)\]\s*(?:,[^()]*)?\)")
_PLAIN_NUMBER = re.compile(rf"{NUMBER}(?:[eE][-+]?[0-9]+)?")
_SHIFTED = re.compile(r"\b(?:track_conveyor_\w+|path_offset_\w+)")  # motion that is added to every target


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program, at their move or in a variable that only moves use."""
    statements = list(parse(text))
    named = _named_targets(statements)
    tool: Array | str = ""
    for statement in statements:
        if shifted := _SHIFTED.search(statement.text):
            reading.refuse(statement.line, f"{shifted[0]} found: what it adds to the targets is not known here")
        if not isinstance(statement, UrMove):
            tool = _tool_after(statement.text, tool)
            given = _NAMED.fullmatch(statement.text)
            if given and given["name"] in named:
                _joints(reading, statement, given, "angles", tool)
            elif re.match(r"interpreter_mode\s*\(", statement.text):
                reading.leave(statement.line, f"'{statement.text}' found: what comes by the network is not in the file")
            elif not _NO_TARGET.match(statement.text) and (found := _hidden_target(statement.text)):
                reading.leave(statement.line, f"'{found}' found; {_ALLOWED}")
            continue
        by_name = _MOVE_BY_NAME.fullmatch(statement.text)
        if by_name is None or by_name["name"] not in named:
            _joints(reading, statement, _TARGET.fullmatch(statement.text), 1, tool)


def _named_targets(statements: Sequence[Statement]) -> set[str]:
    """Return the variables that get six plain angles once, and that nothing but moves to them reads."""
    given = [m["name"] for s in statements if (m := _NAMED.fullmatch(s.text)) and _is_plain(m["angles"])]
    read = (m["name"] for s in statements if isinstance(s, UrMove) and (m := _MOVE_BY_NAME.fullmatch(s.text)))
    said, moved = (Counter(names) for names in (_words(statements), read))
    return {name for name in given if moved[name] and said[name] == 1 + moved[name]}


def _words(statements: Sequence[Statement]) -> Iterator[str]:
    for s in statements:
        yield from re.findall(r"[A-Za-z_]\w*", s.text)


def _is_plain(cells: str) -> bool:
    return all(_ANGLE.fullmatch(cell) for cell in cells.split(","))


def _hidden_target(said: str) -> str:
    """Return the six numbers or more of a place or of joints that stand where no move is, or nothing."""
    found = (m[0] for m in _LISTED.finditer(said) if m["cells"].count(",") >= 5)
    return next((text[:60] for text in found if re.search(r"[1-9]", text)), "")


def _tool_after(said: str, tool: Array | str) -> Array | str:
    """Return the tool in the flange (4, 4) [m] once a statement is run, or why it is not known; ``tool``: before."""
    if not _SETS_TOOL.search(said):
        return tool
    found = _TOOL.fullmatch(said)
    cells = [_PLAIN_NUMBER.fullmatch(cell.strip()) for cell in found[1].split(",")] if found else []
    if len(cells) != 6 or None in cells:
        return "set_tcp without plain numbers"
    return pose(np.eye(3), np.array([float(cell[0]) for cell in cells[:3] if cell]))


def _joints(
    reading: TargetReading, statement: Statement, match: re.Match[str] | None, group: str | int, tool: Array | str
) -> None:
    """Note the angles in a group of a match, or why they are left."""
    angles = [_ANGLE.fullmatch(a) for a in match[group].split(",")] if match else []
    if match is None or None in angles:
        reading.leave(statement.line, f"'{statement.text}' found; {_ALLOWED}")
    elif len(angles) != reading.robot.n_joints:
        reading.leave(statement.line, f"{len(angles)} angles found, the robot has {reading.robot.n_joints} joints")
    else:
        _add(reading, statement, statement.start + match.start(group), [a for a in angles if a is not None], tool)


def _add(
    reading: TargetReading, statement: Statement, start: int, angles: Sequence[re.Match[str]], tool: Array | str
) -> None:
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
        reading.add_joints(statement.line, numbers, tool=tool)
    elif max(abs(n.value) for n in numbers) > 4 * math.pi:
        reading.leave(statement.line, f"'{statement.text}' has angles of more than two turns: are these degrees?")
    else:
        decimals = 7  # of an angle in rad at least
        reading.add_angles(statement.line, numbers, [1.0] * len(numbers), decimals, tool=tool)
