"""The mastering of a head of indicators: what the three show with the master ball in its socket (TriCal paper, 2.1)."""

from dataclasses import dataclass

import numpy as np

from planner.cell import Cell
from planner.run.beside import Beside
from planner.units import UM, Array, frozen, to_mm

TOLERANCE = (
    3 * UM
)  # [m] to which balls are centred (section 3): a zero that is further off moves the tool point by more


@dataclass(frozen=True)
class Mastering:
    """Readings at the master ball.

    Attributes:
        wanted: what each indicator should show [m].
        off: of each check, what the three showed beyond that, (k, 3) [m].
        drift: from the first check to the last, (3,) [m]; zero where there is but one.
    """

    wanted: float
    off: Array
    drift: Array

    @property
    def good(self) -> bool:
        """Whether all checks are within the tolerance."""
        return bool(np.abs(self.off).max() <= TOLERANCE)

    def text(self) -> str:
        """Say it in one sentence."""
        checks = f"{len(self.off)} check{'s' * (len(self.off) > 1)} of the master ball"
        worst, wanted = float(np.abs(self.off).max()) / UM, float(to_mm(self.wanted))
        drift = f", drift from first to last {float(np.abs(self.drift).max()) / UM:.1f} µm" if len(self.off) > 1 else ""
        said = "" if self.good else "; the tool point is off by as much: master the indicators again"
        return f"{checks}: at most {worst:.1f} µm from {wanted:.3f} mm{drift}{said}"


def mastering(cell: Cell, said: Beside) -> Mastering | None:
    """Judge the checks that a run's file has above its columns; ``None`` where it has none."""
    if not said.masters or cell.gauge.head is None:
        return None
    wanted = cell.gauge.head.master / 2 - cell.balls[0].radius
    off = np.array(said.masters) - wanted
    return Mastering(wanted, frozen(off), frozen(off[-1] - off[0]))
