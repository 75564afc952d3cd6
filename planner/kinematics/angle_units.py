"""Joint angles that are called degrees, but move as radians do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import TURN, Array

NOTE = "angles"  # `# angles: degrees` at the head of a file: the arm really moved so little
DEGREES = "degrees"


@dataclass(frozen=True)
class SmallAngles:
    """Angles in degrees of which none lies beyond what a turn is in radians.

    Attributes:
        largest: of all, without sign.
        spread: how far the joint that moves most moves.
        rows: of how many positions.
    """

    largest: float
    spread: float
    rows: int

    @property
    def are_radians(self) -> bool:
        """Whether they move so far there that they are radians: an arm that works moves by tens of degrees."""
        return self.spread > 1.0 and self.rows > 1

    def refusal(self, columns: str, cure: str) -> str:
        """Return why ``columns`` are not taken; ``cure``: how they are called where they are radians."""
        return (
            f"the columns {columns} are called degrees, but all joints stay within ±{self.largest:.3g}: radians look "
            f"like that; call them {cure} …, or write '# {NOTE}: {DEGREES}' above if the arm really moves so little"
        )

    def describe_doubt(self, columns: str, cure: str) -> str:
        """Return what is to be said where they do not move far enough to tell."""
        return (
            f"no joint moves by more than {self.spread:.3g} degrees ({columns}); if these are radians, call them {cure}"
        )


def find_small(degrees: Array) -> SmallAngles | None:
    """Return what angles (n, k) [deg] have of radians; ``None`` where they reach further than a turn in radians."""
    if degrees.size == 0 or np.abs(degrees).max() > TURN + 0.01:
        return None
    return SmallAngles(float(np.abs(degrees).max()), float(np.ptp(degrees, axis=0).max()), len(degrees))


def radians_text(key: str, degrees: Sequence[float | None]) -> str:
    """Return why the angles of a robot's rows are not taken for degrees; empty where they may be.

    They are radians where none lies beyond half a turn of radians, and one is a quarter or half turn of these: in
    degrees an arm of such rows would have all its axes parallel, or a posture that nobody draws.
    """
    rounded = 2e-3  # [rad] of a right angle that is written as 1.57
    said = [v for v in degrees if v]
    right = [v for v in said if min(abs(abs(v) - np.pi / 2), abs(abs(v) - np.pi)) < rounded]
    if not right or max(map(abs, said)) > np.pi + rounded:
        return ""
    meant = ", ".join(f"{np.rad2deg(v):.6g}" for v in (v or 0.0 for v in degrees))
    return (
        f"{key} of the rows looks like radians ({right[0]:g} is a right angle or a half turn); it is in degrees: "
        f"if radians are meant, [{meant}]"
    )


def degrees_text(radians: Sequence[float]) -> str:
    """Return why angles that a file has in radians are not taken for radians; empty where they may be.

    Beyond a turn only multiples of 45° are radians that somebody computed (5π/2), and beyond half a turn nobody writes
    a round number of radians (4.5).
    """
    rounded, most_turns = 2e-3, 2.0  # [rad] of a multiple that is written with three digits; [turns]
    for v in map(abs, radians):
        is_multiple = abs(v / (np.pi / 4) - round(v / (np.pi / 4))) * np.pi / 4 < rounded and v < most_turns * TURN
        is_round = abs(10 * v - round(10 * v)) < 1e-9  # one decimal at most
        if v > np.pi + rounded and not is_multiple and (is_round or v > TURN + rounded):
            return f"{v:g} rad are {v / TURN:.3g} turns: this looks like degrees, and is in radians"
    return ""
