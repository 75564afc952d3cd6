"""Joint angles that are called degrees, but move as radians do."""

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

    def doubt(self, columns: str, cure: str) -> str:
        """Return what is to be said where they do not move far enough to tell."""
        return (
            f"no joint moves by more than {self.spread:.3g} degrees ({columns}); if these are radians, call them {cure}"
        )


def find_small(degrees: Array) -> SmallAngles | None:
    """Return what angles (n, k) [deg] have of radians; ``None`` where they reach further than a turn in radians."""
    if degrees.size == 0 or np.abs(degrees).max() > TURN + 0.01:
        return None
    return SmallAngles(float(np.abs(degrees).max()), float(np.ptp(degrees, axis=0).max()), len(degrees))
