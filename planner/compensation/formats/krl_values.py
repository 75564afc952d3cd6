"""KRL's aggregates, their configuration, and which tool and base stand at a line."""

import re
from dataclasses import dataclass

import numpy as np

from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.arm_shapes import NEAR
from planner.compensation.rotations import frame, from_abc
from planner.compensation.targets import TargetReading
from planner.programs.languages.text import EXPONENT_NUMBER, Slot

MM_DECIMALS, DEG_DECIMALS = 4, 5
POSE_KEYS = ("X", "Y", "Z", "A", "B", "C")
EXTERNAL = tuple(f"E{i}" for i in range(1, 7))
ACCURATE = 16  # status bit of a point that was taught on a robot with an accuracy model of its own
_WHOLE = r"'B\s*[01]+'|'H\s*[0-9A-F]+'|\d+"


@dataclass(frozen=True)
class AggregateEntry:
    """One number of an aggregate: its value as written, and its place."""

    value: float
    start: int
    end: int

    def slot(self, unit: float) -> Slot:
        """Return the place that the corrected number goes to; ``unit`` 1 is a whole number."""
        decimals = {MM: MM_DECIMALS, DEG: DEG_DECIMALS}.get(unit, 0)
        return Slot(self.start, self.end, unit, decimals, aligned=unit != 1.0)


def entries(text: str, place: int) -> dict[str, AggregateEntry] | None:
    """Return the numbers of an aggregate by their names, or None where it holds anything else.

    Args:
        text: from ``{`` to ``}``.
        place: of the ``{`` in the file.
    """
    head = re.match(r"\{\s*(\w+\s*:)?", text)
    found: dict[str, AggregateEntry] = {}
    at = 0 if head is None else head.end()
    for cell in text[at:-1].split(","):
        match = re.fullmatch(rf"(\s*(\w+)\s+)({EXPONENT_NUMBER}|{_WHOLE})\s*", cell, re.IGNORECASE)
        if match is None or match[2].upper() in found:
            return None
        start = place + at + len(match[1])
        found[match[2].upper()] = AggregateEntry(_number(match[3]), start, start + len(match[3]))
        at += len(cell) + 1
    return found


def _number(text: str) -> float:
    if text.startswith("'"):
        return float(int(text[2:-1], 2 if text[1] in "Bb" else 16))
    return float(text)


def transform(found: dict[str, AggregateEntry]) -> Array:
    """Return the transform (4, 4) [m] of an aggregate with X, Y, Z, A, B, C."""
    values = np.array([found[key].value for key in POSE_KEYS])
    return read_only(frame(values[None, :3] * MM, from_abc(values[None, 3:] * DEG))[0])


@dataclass(frozen=True)
class StatusTurn:
    """KUKA's status and turn: the shape of the arm, and a bit for each joint that is negative."""

    status: int
    turn: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: bits 0 and 1 are KUKA's own; the sign of A5 is taken from the turn.

        Manuals differ about the sense of status bit 2, none about the turn's.
        """
        return (self.status & 3) | (self.turn >> 4 & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether the joints q (n, N) [rad] have the signs that are said; near zero either will do."""
        negative = (self.turn >> np.arange(q.shape[1])) & 1
        return np.asarray((np.abs(q) < NEAR) | ((q < 0) == (negative == 1)))

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return status and turn, with the bits changed whose sign the correction (N,) [rad] has changed."""
        crossed = (q < 0) != (q_new < 0)
        return self.status ^ (before ^ after), self.turn ^ int(crossed @ (1 << np.arange(len(q))))


_SET = re.compile(r"\s*\$(?P<which>TOOL|BASE)\s*=\s*(?P<value>.*)", re.IGNORECASE)
_BAS = re.compile(r"\s*BAS\s*\(\s*#(?P<what>\w+)\s*(?:,\s*(?P<value>[^)]*?)\s*)?\)", re.IGNORECASE)
_DATA = re.compile(r"(?P<table>TOOL|BASE)_DATA\[\s*(?P<index>\d+)\s*\]\s*=\s*(?P<value>\{[^}]*\})", re.IGNORECASE)
_FDAT = re.compile(r"\bFDAT\s+F(?P<name>\w+)\s*=\s*\{(?P<value>[^}]*)\}", re.IGNORECASE)
_OPENING = re.compile(r"\s*(IF|FOR|LOOP|WHILE|REPEAT|SWITCH)\b", re.IGNORECASE)
_CLOSING = re.compile(r"\s*(ENDIF|ENDFOR|ENDLOOP|ENDWHILE|UNTIL|ENDSWITCH)\b", re.IGNORECASE)
Frame = Array | None


class FrameState:
    """Tool and base as they stand at a line; None where the file does not say them for certain."""

    hint = (
        ": say it by $TOOL, $BASE, BAS (#TOOL,n), BAS (#BASE,n) before the move (outside of IF and loops), give the "
        "controller's $config.dat for numbered frames (--frames), or name them yourself (--tool, --base)"
    )

    def __init__(self, text: str, reading: TargetReading) -> None:
        self._reading = reading
        self._tables: dict[tuple[str, int], Array] = {("TOOL", 0): np.eye(4), ("BASE", 0): np.eye(4)}
        for source in (reading.frames.data, text):
            for match in _DATA.finditer(source):
                found = entries(match["value"], 0)
                if found is not None and set(POSE_KEYS) <= found.keys():
                    self._tables[match["table"].upper(), int(match["index"])] = transform(found)
        self._points = {m["name"].upper(): m["value"].upper() for m in _FDAT.finditer(text)}
        self._now: dict[str, Frame] = {"TOOL": None, "BASE": None}
        self._depth = 0
        self._doubtful = False

    def given(self) -> tuple[Frame, Frame]:
        """Return tool and base that the person has named."""
        return self._reading.frames.T_FT, self._reading.frames.T_WB

    def now(self) -> tuple[Frame, Frame]:
        """Return tool and base at this line."""
        T_FT, T_WB = self.given()
        if self._doubtful:
            return T_FT, T_WB
        tool, base = self._now["TOOL"], self._now["BASE"]
        return T_FT if tool is None else tool, T_WB if base is None else base

    def of_point(self, name: str) -> tuple[Frame, Frame] | None:
        """Return tool and base of a point taught by inline form: XP1 goes with FP1; None where it has no FDAT."""
        data = self._points.get(name[1:]) if name.startswith("X") else None
        if data is None:
            return None
        numbers = dict(re.findall(r"\b(TOOL|BASE)_NO\s+(-?\d+)", data))
        if re.search(r"IPO_FRAME\s+#TCP", data) or len(numbers) != 2:
            return None, None
        T_FT, T_WB = self.given()
        tool, base = (self._tables.get((w, int(numbers[w]))) for w in ("TOOL", "BASE"))
        return T_FT if tool is None else tool, T_WB if base is None else base

    def forget(self) -> None:
        """Forget what was set: another program may have set something else."""
        self._now = {"TOOL": None, "BASE": None}
        self._depth, self._doubtful = 0, False

    def branch(self, line: str) -> None:
        """Count how deep in IF and loops the next line is."""
        self._depth += bool(_OPENING.match(line)) - bool(_CLOSING.match(line))

    def statement(self, number: int, place: int, line: str) -> bool:
        """Take in a line that sets a frame; return whether it was one."""
        if match := _SET.match(line):
            self._set(match["which"].upper(), self._value(match["value"].strip(), place))
            return True
        if match := _BAS.match(line):
            what = match["what"].upper()
            if what in ("TOOL", "BASE"):
                index = match["value"] or ""
                self._set(what, self._tables.get((what, int(index))) if index.isdigit() else None)
            elif what in ("INITMOV", "FRAMES", "EX_BASE", "BASE_TCP", "TCP_IPO", "EX_TOOL"):
                self._set("TOOL", None)
                self._set("BASE", None)
            return True
        return False

    def _set(self, which: str, value: Frame) -> None:
        self._now[which] = value
        self._doubtful |= self._depth > 0

    def _value(self, value: str, place: int) -> Frame:
        if value.upper() == "$NULLFRAME":
            return np.eye(4)
        if match := re.fullmatch(r"(TOOL|BASE)_DATA\[\s*(\d+)\s*\]", value, re.IGNORECASE):
            return self._tables.get((match[1].upper(), int(match[2])))
        found = entries(value, place) if value.startswith("{") and value.endswith("}") else None
        return transform(found) if found is not None and set(POSE_KEYS) <= found.keys() else None
