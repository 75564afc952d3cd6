"""FANUC TP as ASCII (.LS): positions that are taught in joint angles, and the moves that use them."""

import re
from dataclasses import dataclass, field

from planner.compensation.targets import TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.statements import NUMBER, Lines, PlacedNumber

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
_POSITION = re.compile(
    r'^[ \t]*P\[(?P<number>\d+)(?::(?:\s*"[^"\r\n]*"|[^\]\r\n]*))?\]\s*\{(?P<body>[^{}]*)\}[ \t]*;?', re.MULTILINE
)
_GROUP = re.compile(r"\s*GP1\s*:\s*UF\s*:\s*\w+\s*,\s*UT\s*:\s*\w+\s*,(?P<cells>.*)", re.DOTALL)
_AXIS = re.compile(rf"\s*(?P<axis>[JE]\d)\s*=\s*(?P<value>{NUMBER})\s*(?P<unit>deg|mm)\s*")
_ALLOWED = "P[n] with the angles of group 1 is corrected"
_EVERY = -1  # stands for all numbers, where the program computes which


@dataclass
class _Uses:
    """How the instructions use the positions: first line of each, and why its meaning is not certain."""

    lines: dict[int, int] = field(default_factory=dict)
    doubts: dict[int, str] = field(default_factory=dict)

    def add(self, said: str, line: int, doubt: str) -> None:
        """Take in the positions that an instruction names."""
        for index in re.findall(_POINT, said, re.IGNORECASE):
            number = int(index) if index.isdecimal() else _EVERY
            self.lines.setdefault(number, line)
            if doubt:
                self.doubts.setdefault(number, doubt)


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program; what else is a target or not understood is told and left."""
    lines = Lines.of(text)
    section = re.search(r"^/POS\b", text, re.MULTILINE)
    at = len(text) if section is None else section.end()
    uses = _read_instructions(text[: at if section is None else section.start()], lines, reading)
    if section and (late := re.search(r"^/MN\b", text[at:], re.MULTILINE)):
        reading.refuse(lines.number(at + late.start()), "/MN stands behind /POS; the positions are last in a program")
    found = list(_POSITION.finditer(text, at))
    numbers = [int(position["number"]) for position in found]
    for position, number in zip(found, numbers, strict=True):
        _tell_rest(text, at, position.start(), lines, reading)
        at = position.end()
        angles = _angles(position, reading.axes)
        doubt = uses.doubts.get(number) or uses.doubts.get(_EVERY)
        if numbers.count(number) > 1:
            angles = f"stands {numbers.count(number)} times in this file"
        elif not isinstance(angles, str) and doubt:
            angles = f"is not certain: {doubt}"
        line = lines.number(position.start("number"))
        if isinstance(angles, str):
            reading.leave(line, f"P[{number}] {angles}")
        else:
            reading.add_joints(line, angles)
    _tell_rest(text, at, len(text), lines, reading)
    for number in uses.lines.keys() - {_EVERY, *numbers}:
        reading.leave(uses.lines[number], f"P[{number}] is not among the positions of this file")


def _read_instructions(text: str, lines: Lines, reading: TargetReading) -> _Uses:
    """Read the section /MN, whose instructions end with a semicolon and may go over lines."""
    uses = _Uses()
    begin = re.search(r"^/MN\b", text, re.MULTILINE)
    if begin and (tracking := re.search(r"^\s*LINE_TRACK\b", text[: begin.start()], re.MULTILINE)):
        line = lines.number(tracking.start())
        uses.doubts[_EVERY] = f"line tracking in line {line} moves the frame of every target"
    for piece in re.finditer(r"[^;]+", text[begin.end() :] if begin else text):
        said = " ".join(re.sub(r"(?m)^\s*\d*\s*:", " ", _COMMENT.sub(r"\1]", piece[0])).split())
        place = piece.start() + len(piece[0]) - len(piece[0].lstrip()) + (begin.end() if begin else 0)
        line = lines.number(place)
        shown = f"'{said[:60]}' in line {line}"
        if _REMARK.match(said):
            continue
        if motion := _MOTION.fullmatch(said):
            uses.add(said, line, "" if _HARMLESS.fullmatch(motion["options"]) else f"{shown} may shift it")
        elif re.match(r"[JLCAS] PR\[", said):
            reading.leave(line, f"'{said[:60]}' found; {_ALLOWED}, position registers are not in the file")
        elif _SHIFT.match(said) and not re.search(_POINT, said, re.IGNORECASE):
            uses.doubts.setdefault(_EVERY, f"{shown} may shift every target")
        else:
            if re.match(r"[JLCAS] \w+\[", said):
                reading.leave(line, f"'{said[:60]}' found; {_ALLOWED}")
            uses.add(said, line, f"{shown} uses it too")
    return uses


def _angles(position: re.Match[str], axes: tuple[str, ...]) -> list[PlacedNumber] | str:
    """Return the angles of a position in the order of the robot's axes, or why it is left."""
    body, start = position["body"], position.start("body")
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


def _tell_rest(text: str, start: int, end: int, lines: Lines, reading: TargetReading) -> None:
    """Tell what stands between the positions and is none."""
    if rest := re.search(r"^[ \t]*(?!/END\b)(\S.*)", text[start:end], re.MULTILINE):
        reading.leave(lines.number(start + rest.start(1)), f"'{rest[1].strip()[:60]}' is not understood; {_ALLOWED}")
