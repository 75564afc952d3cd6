"""Comau PDL2: joint targets in braces."""

import re
from collections.abc import Iterator

import numpy as np

from planner.common.units import Array, from_mm
from planner.compensation.points import SENTENCE, is_service_name
from planner.compensation.targets import TargetReading
from planner.kinematics.geometry import pose
from planner.programs.dialect import Dialect
from planner.programs.languages.pdl2 import Pdl2Move, parse
from planner.programs.languages.statements import NUMBER, Lines, Routine, Statement

_MANNER = re.compile(r"(?:ARM\s*\[\s*(?P<arm>\d+)\s*\]\s*)?(?:JOINT|LINEAR)?", re.IGNORECASE)
_CLAUSES = re.compile(r"(?:ADVANCE\b)?\s*,?\s*(?:$|(?:WITH|TIL|UNTIL)\b)", re.IGNORECASE)
_OWN_ARM = re.compile(r"^[ \t]*+PROGRAM\b[^\r\n]*\bPROG_ARM\s*=\s*(\w+)", re.IGNORECASE | re.MULTILINE)
_ARM_CHANGED = re.compile(r"\$PROG_ARM\s*:?=", re.IGNORECASE)
_SETS_TOOL = re.compile(r"\$TOOL\b[^=<>]*:=", re.IGNORECASE)
_TOOL = re.compile(
    rf"\$TOOL\s*:=\s*POS\(\s*(?P<x>{NUMBER})\s*,\s*(?P<y>{NUMBER})\s*,\s*(?P<z>{NUMBER})\s*(?:,[^()]*)?\)",
    re.IGNORECASE,
)
_SHIFTED = re.compile(r"\b(?:CONV_TRACK|SENSOR_TRK|SENSOR_SET_OFST)\b|\$SENSOR_ENBL\s*:=", re.IGNORECASE)
_TARGETED = re.compile(
    r"\b(?:MOVE(?:FLY)?|EXECUTE)\b|[{}]|(?<![\w$])\w+\s*:=\s*(?:POS|XTNDPOS|JNTP)\s*\(", re.IGNORECASE
)
_TEXT_OR_REMARK = re.compile(r"(?P<text>'[^'\r\n]*')|--[^\r\n]*")
_ALLOWED = "MOVE TO {…} and MOVEFLY TO {…} in lines of their own with plain angles are corrected"


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program; every other line that says a move or a target is left and told."""
    routine = ""
    own = _OWN_ARM.search(text)
    if own and own[1] != "1":
        reading.notes.append((1, f"PROG_ARM = {own[1]}: the robot is taken to be that arm"))
    statements, written = list(parse(text)), _written_lines(text)
    arm = own[1] if own else "1"
    if changed := next((s.line for s in statements if _ARM_CHANGED.search(s.text)), 0):
        arm = f"set in line {changed}"
    tool: Array | str = ""
    for statement in statements:
        tool = _tool_after(statement, tool)
        if shifted := _SHIFTED.search(statement.text):
            said = f"{shifted[0]} found: what a belt or a sensor adds to the targets is not known here"
            reading.refuse(statement.line, said)
        if isinstance(statement, Routine):
            routine = statement.name
        is_move = isinstance(statement, Pdl2Move)
        rows = list(_rows(statement, written))
        inside = [
            (n, said[:60]) for n, code, said in rows if _TARGETED.search(code) and (not is_move or n > rows[0][0])
        ]
        for line, said in inside:
            reading.leave(line, f"'{said}' found; {_ALLOWED}")
        if isinstance(statement, Pdl2Move):
            _move(statement, rows[0][2], routine, arm, bool(inside), reading, tool)


def _tool_after(statement: Statement, tool: Array | str) -> Array | str:
    """Return the tool in the flange (4, 4) [m] once a statement is run, or why it is not known; ``tool``: before."""
    if not _SETS_TOOL.search(statement.text):
        return tool
    found = _TOOL.fullmatch(statement.text.strip())
    if found is None:
        return "$TOOL is no POS of plain numbers"
    return pose(np.eye(3), from_mm([float(found[axis]) for axis in "xyz"]))


def _written_lines(text: str) -> list[str]:
    """Return the lines as they are written, without remarks; texts in quotes stay."""
    plain = _TEXT_OR_REMARK.sub(lambda found: found["text"] or " " * len(found[0]), text)
    return [said.strip() for _, _, said in Lines.of(plain)]


def _rows(statement: Statement, written: list[str]) -> Iterator[tuple[int, str, str]]:
    """Yield the lines of a statement: number, code with its texts in quotes blanked, and the line as it is written."""
    for line, code in enumerate(re.split(r"\r\n|\n|\r", statement.text), start=statement.line):
        yield line, code, written[line - 1]


def _move(
    move: Pdl2Move, said: str, routine: str, own_arm: str, unclear: bool, reading: TargetReading, tool: Array | str
) -> None:
    line = move.line
    manner, n = _MANNER.fullmatch(move.how), reading.robot.n_joints
    if is_service_name(routine) or is_service_name(move.target):
        reading.leave(line, f"'{said}' {SENTENCE}")
    elif manner and not own_arm.isdigit():
        reading.leave(line, f"'{said}' moves an arm that is not certain: the program's own one is {own_arm}")
    elif manner and manner["arm"] not in (None, own_arm):
        reading.leave(line, f"'{said}' moves arm {manner['arm']}; the program's own arm is {own_arm}")
    elif unclear or not manner or not move.target.startswith("{") or not _CLAUSES.match(move.rest) or "{" in move.rest:
        reading.leave(line, f"'{said}' found; {_ALLOWED}")
    elif move.numbers is None or len(move.numbers) != n:
        reading.leave(line, f"'{move.target}' found; {n} plain angles in degrees are corrected")
    else:
        reading.add_joints(line, move.numbers, tool=tool)
