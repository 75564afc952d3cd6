"""KRL's aggregates ``{A1 10, A2 -90, …}`` and ``{X …, Y …, …, S …, T …}``, with the place of each number."""

import re
from dataclasses import dataclass

import numpy as np

from planner.compensation.rotations import frame, from_abc
from planner.compensation.shapes import NEAR
from planner.compensation.text import EXPONENT_NUMBER, Slot
from planner.units import DEG, MM, Array, frozen

MM_DECIMALS, DEG_DECIMALS = 4, 5
POSE_KEYS = ("X", "Y", "Z", "A", "B", "C")
EXTERNAL = tuple(f"E{i}" for i in range(1, 7))
ACCURATE = 16  # status bit of a point that was taught on a robot with an accuracy model of its own
_WHOLE = r"'B\s*[01]+'|'H\s*[0-9A-F]+'|\d+"


@dataclass(frozen=True)
class Entry:
    """One number of an aggregate: its value as written, and its place."""

    value: float
    start: int
    end: int

    def slot(self, unit: float) -> Slot:
        """Return the place that the corrected number goes to; ``unit`` 1 is a whole number."""
        decimals = {MM: MM_DECIMALS, DEG: DEG_DECIMALS}.get(unit, 0)
        return Slot(self.start, self.end, unit, decimals, aligned=unit != 1.0)


def entries(text: str, place: int) -> dict[str, Entry] | None:
    """Return the numbers of an aggregate by their names, or None where it holds anything else.

    Args:
        text: from ``{`` to ``}``.
        place: of the ``{`` in the file.
    """
    head = re.match(r"\{\s*(\w+\s*:)?", text)
    found: dict[str, Entry] = {}
    at = 0 if head is None else head.end()
    for cell in text[at:-1].split(","):
        match = re.fullmatch(rf"(\s*(\w+)\s+)({EXPONENT_NUMBER}|{_WHOLE})\s*", cell, re.IGNORECASE)
        if match is None or match[2].upper() in found:
            return None
        start = place + at + len(match[1])
        found[match[2].upper()] = Entry(_number(match[3]), start, start + len(match[3]))
        at += len(cell) + 1
    return found


def _number(text: str) -> float:
    if text.startswith("'"):
        return float(int(text[2:-1], 2 if text[1] in "Bb" else 16))
    return float(text)


def transform(found: dict[str, Entry]) -> Array:
    """Return the transform (4, 4) [m] of an aggregate with X, Y, Z, A, B, C."""
    values = np.array([found[key].value for key in POSE_KEYS])
    return frozen(frame(values[None, :3] * MM, from_abc(values[None, 3:] * DEG))[0])


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
