"""ABB RAPID: jointtarget and robtarget, declared by name or written at the move."""

import re
from dataclasses import dataclass, field

import numpy as np

from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.arm_shapes import NEAR
from planner.compensation.dialect_words import DialectWords
from planner.compensation.formats.csv import pose_of
from planner.compensation.targets import EXTERNAL_NOTE, CartesianTarget, Target, TargetReading
from planner.programs.languages.text import EXPONENT_NUMBER, Lines, Slot, mask_comments

UNUSED = 8e9  # external axes that are not there read 9E9
QUARTER = np.pi / 2
_CONFIGURED = (0, 3, 5)  # joints whose quarter turns cf1, cf4, cf6 count


def _row(count: int) -> str:
    return r"\[\s*" + r"\s*,\s*".join([EXPONENT_NUMBER] * count) + r"\s*\]"


_POSE = rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*\]"
JOINT_TARGET = re.compile(rf"\[\s*{_row(6)}\s*,\s*{_row(6)}\s*\]")
ROB_TARGET = re.compile(rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*,\s*{_row(4)}\s*,\s*{_row(6)}\s*\]")
_TOOL = re.compile(rf"\[\s*TRUE\s*,\s*(?P<pose>{_POSE})\s*,.*", re.IGNORECASE | re.DOTALL)
_WORK_OBJECT = re.compile(
    rf"\[\s*FALSE\s*,\s*TRUE\s*,\s*(\"[^\"]*\")?\s*,\s*(?P<user>{_POSE})\s*,\s*(?P<object>{_POSE})\s*\]",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class PlacedNumber:
    """A number as written, and its place."""

    value: float
    start: int
    end: int


def numbers(text: str, place: int) -> list[PlacedNumber]:
    """Return the numbers of a value in brackets, in order."""
    return [PlacedNumber(float(m[0]), place + m.start(), place + m.end()) for m in re.finditer(EXPONENT_NUMBER, text)]


def transform(values: list[float]) -> Array:
    """Return the transform (4, 4) [m] of x, y, z [mm] and a quaternion."""
    return pose_of(np.array(values[:3]) * MM, np.array(values[3:7]))


def tool_of(text: str) -> Array | None:
    """Return T_FT (4, 4) [m] of a tooldata that the robot carries, else None."""
    match = _TOOL.fullmatch(text)
    return None if match is None else transform([n.value for n in numbers(match["pose"], 0)])


def work_object_of(text: str) -> Array | None:
    """Return T_WB (4, 4) [m] of a wobjdata that stands still, else None."""
    match = _WORK_OBJECT.fullmatch(text)
    if match is None:
        return None
    user, inside = (transform([n.value for n in numbers(match[k], 0)]) for k in ("user", "object"))
    return np.asarray(user @ inside)


@dataclass(frozen=True)
class ConfData:
    """RAPID's confdata: quarter turns of joints 1, 4 and 6, and the shape of the arm."""

    quarters: tuple[int, int, int]
    cfx: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: cfx counts axis 1, lower arm (in front is 0) and joint 5 from its highest bit."""
        return (self.cfx >> 2) | ((~self.cfx >> 1 & 1) << 1) | (self.cfx & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether joints 1, 4, 6 of q (n, 6) [rad] are in their quarters; at a border either will do."""
        fits = np.ones(q.shape, dtype=bool)
        for joint, quarter in zip(_CONFIGURED, self.quarters, strict=True):
            low = quarter * QUARTER
            fits[:, joint] = (q[:, joint] > low - NEAR) & (q[:, joint] < low + QUARTER + NEAR)
        return fits

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return cf1, cf4, cf6, cfx with what the correction (6,) [rad] carries over a border."""
        changed = [int(np.floor(q_new[j] / QUARTER) - np.floor(q[j] / QUARTER)) for j in _CONFIGURED]
        flips = before ^ after
        cfx = self.cfx ^ ((flips & 1) << 2 | (flips & 2) | flips >> 2)
        return (*(c + d for c, d in zip(self.quarters, changed, strict=True)), cfx)


MM_DECIMALS, DEG_DECIMALS, QUATERNION_DECIMALS = 4, 5, 8
_DECLARED = re.compile(
    r"\b(?P<how>CONST|PERS|VAR)\s+(?P<type>robtarget|jointtarget|tooldata|wobjdata)\s+(?P<name>\w+)\s*"
    r"(?P<array>\{[^}]*\})?\s*:=\s*(?P<value>.*)",
    re.IGNORECASE | re.DOTALL,
)
_MOVE = re.compile(
    r"\b(?P<word>(?:Move|Trigg)(?:AbsJ|J|L|C(?!heck))\w*|Search[LC]\w*)\b(?P<rest>.*)", re.IGNORECASE | re.DOTALL
)
_ASSIGNED = re.compile(r"(?:^|\s)(?P<name>\w+)\s*(?:\{[^}]*\}\s*)?(?:\.[\w.]+\s*)?:=", re.IGNORECASE)
_DISPLACED = re.compile(r"\b(ConfJ|ConfL)\s*\\\s*Off\b|\b(PDispOn|PDispSet|EOffsOn|EOffsSet)\b", re.IGNORECASE)
Frames = tuple[Array | None, Array | None]


@dataclass
class _RapidPoint:
    """A robtarget in the file, with tool and work object of the moves that use it."""

    line: int
    place: int
    value: str
    frames: list[tuple[str, str]] = field(default_factory=list)


def read(text: str, _words: DialectWords, reading: TargetReading) -> None:
    """Note the targets of one module."""
    _RapidTargets(text, reading).run()


class _RapidTargets:
    """Declarations and moves of a module; statements end with a semicolon."""

    def __init__(self, text: str, reading: TargetReading) -> None:
        self.reading = reading
        self.plain = text
        self.text = mask_comments(text, r"![^\r\n]*")
        self.lines = Lines.of(text)
        self.points: dict[str, _RapidPoint] = {}
        self.known: set[str] = set()
        self.used: dict[str, int] = {}
        self.assigned: dict[str, int] = {}
        self.tools: dict[str, Array | None] = {"tool0": np.eye(4)}
        self.objects: dict[str, Array | None] = {"wobj0": np.eye(4)}
        self.displaced: tuple[int, str] | None = None

    def run(self) -> None:
        """Note every target, declared or written at its move; refuse points that the program computes."""
        self._frames_of(mask_comments(self.reading.frames.data, r"![^\r\n]*", ""))
        for match in re.finditer(r"[^;]*;", self.text):
            self._statement(match.start(), match[0][:-1])
        for name in self.used.keys() & self.assigned.keys():
            self._refuse(self.used[name], f"{name} is computed while the program runs (line {self.assigned[name]})")
        for name, number in sorted(self.used.items(), key=lambda item: item[1]):
            if name not in self.known and name not in self.assigned:
                self.reading.notes.append(
                    (number, f"{name} is declared elsewhere: compensate the module that declares it too")
                )
        for point in self.points.values():
            self._pose(point)

    def _refuse(self, line: int, sentence: str) -> None:
        self.reading.refusals.add(line, sentence)

    def _statement(self, place: int, statement: str) -> None:
        if match := _DECLARED.search(statement):
            self._declared(place, match)
        elif match := _MOVE.search(statement):
            self._move(place, match)
        elif match := _ASSIGNED.search(statement):
            self.assigned.setdefault(match["name"].lower(), self.lines.number(place + match.start("name")))
        elif (match := _DISPLACED.search(statement)) and self.displaced is None:
            self.displaced = self.lines.number(place + match.start()), match[0]

    def _frames_of(self, text: str) -> None:
        for statement in text.split(";"):
            if match := _DECLARED.search(statement):
                self._frame(match, match["value"].strip())

    def _frame(self, match: re.Match[str], value: str) -> bool:
        kind, name = match["type"].lower(), match["name"].lower()
        if kind == "tooldata":
            self.tools[name] = tool_of(value)
        elif kind == "wobjdata":
            self.objects[name] = work_object_of(value)
        return kind in ("tooldata", "wobjdata")

    def _declared(self, place: int, match: re.Match[str]) -> None:
        value, start = match["value"].rstrip(), place + match.start("value")
        number, name = self.lines.number(start), match["name"].lower()
        if self._frame(match, self.plain[start : start + len(value)]):
            return
        self.known.add(name)
        if match["array"]:
            self._refuse(
                number, f"an array of targets found ({match['name']}{match['array']}); single targets are allowed"
            )
        elif JOINT_TARGET.fullmatch(value) and match["type"].lower() == "jointtarget":
            self._joints(number, start, value)
        elif ROB_TARGET.fullmatch(value) and match["type"].lower() == "robtarget":
            self.points[name] = _RapidPoint(number, start, value)
        else:
            self._refuse(number, f"{match['name']} := {value[:60]} found; plain numbers in brackets are allowed")

    def _move(self, place: int, match: re.Match[str]) -> None:
        word, rest, start = match["word"].lower(), match["rest"], place + match.start("rest")
        number = self.lines.number(place + match.start("word"))
        arguments = [(a, start + at) for a, at in _arguments(rest) if not a.strip().startswith("\\")]
        first = 0
        if word.startswith("search"):  # signal, what is found, and then the targets
            first = 2
            self.assigned.setdefault(arguments[min(1, len(arguments) - 1)][0].strip().lower(), number)
        last = first + (2 if re.match(r"(move|trigg|search)c", word) else 1)
        tool = next((a for a, _ in reversed(arguments) if not a.strip().startswith("[")), "")
        name = re.match(r"\s*(\w+)", tool)
        work_object = re.search(r"\\\s*WObj\s*:=\s*(\w+)", tool, re.IGNORECASE)
        frames = "" if name is None else name[1].lower(), "wobj0" if work_object is None else work_object[1].lower()
        for text, at in arguments[first:last]:
            self._argument(number, at, text, frames)

    def _argument(self, number: int, place: int, text: str, frames: tuple[str, str]) -> None:
        value, place = text.strip(), place + len(text) - len(text.lstrip())
        name = re.match(r"(\w+)\s*(?:\\\s*NoEOffs|\\\s*ID\s*:=\s*\w+)?\s*$", value, re.IGNORECASE)
        if JOINT_TARGET.fullmatch(value):
            self._joints(number, place, value)
        elif ROB_TARGET.fullmatch(value):
            self.points[f"at {place}"] = _RapidPoint(number, place, value, [frames])
        elif name:
            self.used.setdefault(name[1].lower(), number)
            if name[1].lower() in self.points:
                self.points[name[1].lower()].frames.append(frames)
        else:
            self._refuse(number, f"'{value[:60]}' found as a target; a name or plain numbers in brackets are allowed")

    def _joints(self, line: int, place: int, value: str) -> None:
        found = numbers(value, place)[: self.reading.robot.n_joints]
        if any(n.value > UNUSED for n in found):
            self._refuse(line, f"an axis without a number (9E9) found; the robot has {len(found)} joints")
            return
        slots = tuple(Slot(n.start, n.end, DEG, DEG_DECIMALS) for n in found)
        self.reading.targets.append(Target(line, slots, q=read_only([n.value * DEG for n in found])))

    def _pose(self, point: _RapidPoint) -> None:
        found = numbers(point.value, point.place)
        values = [n.value for n in found]
        conf = [round(v) for v in values[7:11]]
        refused = self._why_not(point, values, conf)
        T_FT, T_WB = self._frames_at(point)
        if refused is None and (T_FT is None or T_WB is None):
            names = ", ".join(sorted({f"{t} and {w}" for t, w in point.frames})) or "no move of this file"
            refused = (
                f"tool and work object of this target are not known ({names}): declare them in the module, give a "
                "module that does (--frames), or name them yourself (--tool, --base)"
            )
        if refused is not None or T_FT is None or T_WB is None:
            self._refuse(point.line, refused or "")
            return
        if any(v < UNUSED for v in values[11:]):
            self.reading.notes.append((point.line, EXTERNAL_NOTE))
        slots = [Slot(n.start, n.end, MM, MM_DECIMALS) for n in found[:3]]
        slots += [Slot(n.start, n.end, 1.0, QUATERNION_DECIMALS) for n in found[3:7]]
        slots += [Slot(n.start, n.end, 1.0, 0) for n in found[7:11]]
        pose = CartesianTarget(
            transform(values),
            "quaternion",
            read_only(values[3:7]),
            T_WB,
            T_FT,
            ConfData((conf[0], conf[1], conf[2]), conf[3]),
        )
        self.reading.targets.append(Target(point.line, tuple(slots), pose=pose))

    def _why_not(self, point: _RapidPoint, values: list[float], conf: list[int]) -> str | None:
        size = float(np.linalg.norm(values[3:7]))
        if abs(size - 1.0) > 1e-3:
            return f"the quaternion has the length {size:.4f}; 1 is allowed"
        if not 0 <= conf[3] <= 3:
            return f"cfx = {conf[3]} found; 0 … 3 are allowed (the wrist in front of axis 1), or a jointtarget"
        if self.displaced is not None:
            return f"{self.displaced[1]} in line {self.displaced[0]} makes the meaning of this target uncertain"
        return None

    def _frames_at(self, point: _RapidPoint) -> Frames:
        given = self.reading.frames
        frames = [(self.tools.get(t, given.T_FT), self.objects.get(w, given.T_WB)) for t, w in point.frames]
        if not frames:
            return given.T_FT, given.T_WB
        for one, other in ((frames[0][k], f[k]) for f in frames for k in (0, 1)):
            if one is None or other is None or not np.array_equal(one, other):
                return None, None
        return frames[0]


def _arguments(text: str) -> list[tuple[str, int]]:
    """Return the arguments of a call with their places, cut at the commas outside of brackets."""
    found, depth, start = [], 0, 0
    for k, char in enumerate(text):
        depth += (char in "[({") - (char in "])}")
        if char == "," and depth == 0:
            found.append((text[start:k], start))
            start = k + 1
    return [*found, (text[start:], start)]
