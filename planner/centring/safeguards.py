"""What is looked at before every move: contact, range, and whether each indicator follows the robot."""

from dataclasses import dataclass

import numpy as np

from planner.centring.errors import ContactError, DivergingError, RangeError, StuckError
from planner.centring.settings import HeadFile, MovesFile
from planner.units import MM, Array, to_mm

NAMES = ("x", "y", "z")
STUCK, SLOW, FAST = 0.2, 0.5, 1.5  # of the movement that was to be seen
SHARE = 0.3  # of the largest expected movement: smaller ones are ruled by how the head is tilted
WORSE = 1.5  # times the best so far, and judge_mm more, is no centring


def check_contact(reading: Array, head: HeadFile) -> None:
    """Every indicator must touch the ball, and be used no further than it may.

    Raises:
        ContactError: a plunger stands at its free end.
        RangeError: a plunger is pushed in too far.
    """
    shown = to_mm(reading)
    for name, value in zip(NAMES, shown, strict=True):
        if value <= -head.usable_mm:
            raise ContactError(
                f"indicator {name} shows {value:+.3f} mm (usable are ±{head.usable_mm:g} mm), so it does not touch the "
                "ball: that is further away than the head can reach, or the contact was lost"
            )
        if value >= head.usable_mm:
            raise RangeError(
                f"indicator {name} shows {value:+.3f} mm; usable are ±{head.usable_mm:g} mm: "
                "the ball stands too far in the head"
            )


def check_free(reading: Array, head: HeadFile) -> None:
    """Off the ball every plunger must stand at its free end: one that does not is stuck, or touches something.

    Raises:
        ContactError: an indicator shows that it touches.
    """
    for name, value in zip(NAMES, to_mm(reading), strict=True):
        if value > -head.usable_mm:
            raise ContactError(
                f"indicator {name} shows {value:+.3f} mm off the ball, where it should stand at its free end (below "
                f"−{head.usable_mm:g} mm): its plunger is stuck, it was mastered wrongly, or it touches something"
            )


@dataclass
class Watch:
    """Follows one centring and compares what each indicator shows with what the moves should have done.

    Attributes:
        to_tool: matrix from readings to the ball in the tool frame, (3, 3).
    """

    to_tool: Array
    limits: MovesFile

    def __post_init__(self) -> None:
        self._first: Array | None = None
        self._last: Array | None = None
        self._best = np.inf
        self._moved, self._step = np.zeros(3), np.zeros(3)

    def moved(self, step: Array) -> None:
        """Note a move of the tool by ``step`` (3,) [m] in its own frame."""
        self._step, self._moved = step, self._moved + step

    def check(self, reading: Array) -> None:
        """Compare a new reading (3,) [m] with the moves so far.

        Raises:
            StuckError: an indicator does not follow.
            DivergingError: one goes the other way, by another measure, or the ball goes away.
        """
        if self._first is None or self._last is None:
            self._first = reading
        else:
            self._follows(reading - self._last, self._step)
            self._follows(reading - self._first, self._moved)
        distance = float(np.linalg.norm(self.to_tool @ reading))
        if distance > max(WORSE * self._best, self._best + self.limits.judge_mm * MM):
            raise DivergingError(
                f"the ball was {self._best / MM:.3f} mm from the centre and is {distance / MM:.3f} mm from it now: "
                "check signs and order of the indicators and the tool frame of the controller"
            )
        self._best, self._last = min(self._best, distance), reading

    def _follows(self, seen: Array, step: Array) -> None:
        """A tool that moves by ``step`` takes the ball the other way in its own frame."""
        expected = np.linalg.solve(self.to_tool, -step)
        judged = np.abs(expected) >= max(self.limits.judge_mm * MM, SHARE * float(np.abs(expected).max()))
        share = np.divide(seen, expected, out=np.ones(3), where=judged)
        still = judged & (np.abs(share) < STUCK)
        if judged.any() and np.array_equal(still, judged) and judged.sum() > 1:
            raise StuckError("the robot was moved and no indicator followed: the robot did not move, or no tip touches")
        for k in np.flatnonzero(judged & ((share < SLOW) | (share > FAST))):
            raise _because(NAMES[k], float(seen[k]), float(expected[k]), float(share[k]))


def _because(name: str, seen: float, expected: float, share: float) -> StuckError | DivergingError:
    moved = f"indicator {name} changed by {seen / MM:+.3f} mm where {expected / MM:+.3f} mm were to be seen"
    if abs(share) < STUCK and not 0.03 < share < 0.05:
        return StuckError(f"{moved}: it is stuck, frozen (HOLD), or along another axis")
    if 0.03 < share < 0.05:
        return StuckError(f"{moved}: does it show inches?")
    if share < 0.0:
        return DivergingError(f"{moved}: it reads the other way round; turn its sign in the matrix of the head")
    return DivergingError(f"{moved}: the tool frame of the controller does not lie along the indicators")
