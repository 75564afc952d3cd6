"""FANUC TP as ASCII (.LS): positions that are taught in joint angles, and the moves that use them."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from planner.compensation.targets import NOT_HELD, TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.fanuc import MAIN, POSITIONS, TO_SEMICOLON, TpAmongPositions, TpHead, TpPosition, parse
from planner.programs.languages.statements import NUMBER, Lines, PlacedNumber, Statement

_COMMENT = re.compile(r'(\[\d+):(?:\s*"[^"\r\n]*"|[^\]\r\n]*)\]')  # of a numbered thing: P[2:"above"]
_REMARK = re.compile(r"!|--|//|(?:REMARK|MESSAGE|CALL|RUN|LBL|JMP)\b")
_AMOUNT = rf"(?:{NUMBER}|A?R\[[^\]]+\])"
_POINT = r"\bP\[ ?(\d+|(?:[^\[\]]|\[[^\]]*\])+?) ?\]"
_MOTION = re.compile(
    rf"[JLCAS] {_POINT}(?: {_POINT})? (?:{_AMOUNT} ?(?:%|[a-z]+/[a-z]+|m?sec)|WELD_SPEED|max_speed)"
    rf" (?:FINE|(?:CNT|CD) ?{_AMOUNT})(?P<options>(?: .*)?)"
)
# The options that leave a target where it is; every other one may shift it (INC, Offset, Tool_Offset, VOFFSET, COORD).
_HARMLESS = re.compile(
    rf"(?: (?:(?:ACC|CR|PSPD|AP_LD|RT_LD|(?:Ind\.)?EV) ?{_AMOUNT}%?|PTH|Wjnt|MROT|BREAK|Skip, ?LBL\[[^\]]+\]"
    rf"|(?:Arc|Weld) (?:Start|End) ?\[[^\]]+\]|(?:TA|TB|DB) ?{_AMOUNT}(?:sec|mm)? ?, ?(?:CALL \w+|DO\[\d+\]=\w+)))*"
)
_SHIFT = re.compile(r"(?!.*\bCONDITION\b).*(?:offset|track|shift)", re.IGNORECASE)
_GROUP = re.compile(r"\s*GP1\s*:\s*UF\s*:\s*\w+\s*,\s*UT\s*:\s*(?P<tool>\w+)\s*,(?P<cells>.*)", re.DOTALL)
_AXIS = re.compile(rf"\s*(?P<axis>[JE]\d)\s*=\s*(?P<value>{NUMBER})\s*(?P<unit>deg|mm)\s*")
_ALLOWED = "P[n] with the angles of group 1 is corrected"
_EVERY = -1  # stands for all numbers, where the program computes which


@dataclass
class _Uses:
    """How the instructions use the positions: first line of each, and why its meaning is not certain."""

    lines: dict[int, int] = field(default_factory=dict)
    doubts: dict[int, str] = field(default_factory=dict)

    def add(self, said: str, line: int, doubt: str) -> None:
        """Read the positions that an instruction names."""
        for index in re.findall(_POINT, said, re.IGNORECASE):
            number = int(index) if index.isdecimal() else _EVERY
            self.lines.setdefault(number, line)
            if doubt:
                self.doubts.setdefault(number, doubt)


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program; what else is a target or not understood is told and left."""
    statements = list(parse(text, TO_SEMICOLON))
    if (section := POSITIONS.search(text)) and (late := MAIN.search(text, section.end())):
        line = Lines.of(text).number(late.start())
        reading.refuse(line, "/MN stands behind /POS; the positions are last in a program")
    uses = _read_instructions(statements, reading)
    numbers = Counter(s.number for s in statements if isinstance(s, TpPosition))
    told = False  # one line of each gap between positions is named
    for s in statements:
        if isinstance(s, TpAmongPositions) and not re.match(r"/END\b", s.text):
            if not told:
                reading.leave(s.line, f"'{s.text[:60]}' is not understood; {_ALLOWED}")
            told = True
        elif isinstance(s, TpPosition):
            told = False
            _position(s, numbers[s.number], uses, reading)
    for number in uses.lines.keys() - {_EVERY, *numbers}:
        reading.leave(uses.lines[number], f"P[{number}] is not among the positions of this file")


def _position(position: TpPosition, count: int, uses: _Uses, reading: TargetReading) -> None:
    """Note a position that stands so many times in the file."""
    angles = _angles(position, reading.axes)
    doubt = uses.doubts.get(position.number) or uses.doubts.get(_EVERY)
    if count > 1:
        angles = f"stands {count} times in this file"
    elif not isinstance(angles, str) and doubt:
        angles = f"is not certain: {doubt}"
    if isinstance(angles, str):
        reading.leave(position.line, f"P[{position.number}] {angles}")
    else:
        group = _GROUP.fullmatch(position.body)
        number = group["tool"] if group else ""
        reading.add_joints(position.line, angles, tool=f"UTOOL {number} {NOT_HELD}" if number.isdecimal() else "")


def _read_instructions(statements: Sequence[Statement], reading: TargetReading) -> _Uses:
    """Read the section /MN."""
    uses = _Uses()
    for s in statements:
        if isinstance(s, TpPosition | TpAmongPositions):
            break
        said = " ".join(_COMMENT.sub(r"\1]", s.text).split())
        shown = f"'{said[:60]}' in line {s.line}"
        if isinstance(s, TpHead):
            if re.match(r"LINE_TRACK\b", s.text):
                uses.doubts.setdefault(_EVERY, f"line tracking in line {s.line} moves the frame of every target")
        elif _REMARK.match(said):
            continue
        elif motion := _MOTION.fullmatch(said):
            uses.add(said, s.line, "" if _HARMLESS.fullmatch(motion["options"]) else f"{shown} may shift it")
        elif re.match(r"[JLCAS] PR\[", said):
            reading.leave(s.line, f"'{said[:60]}' found; {_ALLOWED}, position registers are not in the file")
        elif _SHIFT.match(said) and not re.search(_POINT, said, re.IGNORECASE):
            uses.doubts.setdefault(_EVERY, f"{shown} may shift every target")
        else:
            if re.match(r"[JLCAS] \w+\[", said):
                reading.leave(s.line, f"'{said[:60]}' found; {_ALLOWED}")
            uses.add(said, s.line, f"{shown} uses it too")
    return uses


def _angles(position: TpPosition, axes: tuple[str, ...]) -> list[PlacedNumber] | str:
    """Return the angles of a position in the order of the robot's axes, or why it is left."""
    body, start = position.body, position.body_start
    if re.search(r"\bCONFIG\b", body):
        return "is Cartesian; positions in joint angles are corrected"
    group = _GROUP.fullmatch(body)
    if group is None or len(re.findall(r"\bGP\d", body)) > 1:
        return f"is not of group 1 alone; {_ALLOWED}"
    angles: dict[str, PlacedNumber] = {}
    at = start + group.start("cells")
    for text in group["cells"].split(","):
        cell = _AXIS.fullmatch(text)
        if cell is None or cell["axis"] in angles or (cell["axis"] in axes and cell["unit"] != "deg"):
            return f"holds '{text.strip()[:60]}'; each axis once with a plain number is allowed"
        angles[cell["axis"]] = PlacedNumber(float(cell["value"]), cell["value"], at + cell.start("value"))
        at += len(text) + 1
    if any(axis not in angles for axis in axes) or any(a[0] == "J" and a not in axes for a in angles):
        return f"has the axes {', '.join(angles)}, the robot has {', '.join(axes)}"
    return [angles[axis] for axis in axes]
