"""The travelling-salesman problem in integers."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.common.units import Array, IntArray


@dataclass(frozen=True)
class TourInstance:
    """A symmetric closed tour over n nodes.

    Attributes:
        cost: (n, n) integer costs in units of ``unit_s``, rounded down, without penalty.
        unit_s: [s] what one unit stands for.
        forbidden: (n, n) bool, legs that no tour may use.
    """

    cost: IntArray
    unit_s: float
    forbidden: NDArray[np.bool_]

    @property
    def penalty(self) -> int:
        """Cost added to a forbidden leg: more than any tour costs [units]."""
        return int(self.cost.max(axis=1).sum()) + 1

    def weigh_legs(self) -> IntArray:
        """Return (n, n) costs with penalties on forbidden legs."""
        return np.asarray(self.cost + self.penalty * self.forbidden)

    def length(self, cycle: list[int]) -> int:
        """Return the closed tour's cost with penalties [units]."""
        legs = (np.array(cycle), np.roll(cycle, -1))
        return int(self.cost[legs].sum()) + self.penalty * int(self.forbidden[legs].sum())


def build_instance(cost_s: Array, forbidden: Collection[tuple[int, int]]) -> TourInstance:
    """Turn costs (n, n) [s] and the legs that no tour may use into a problem in integers."""
    unit_s = 1e-6  # [s] one unit of the integer costs, unless the range demands a coarser one
    largest_tour = 10**9  # [units] so that a tour and a forbidden leg fit in Concorde's 32 bits
    while cost_s.max(axis=1).sum() > largest_tour * unit_s:
        unit_s *= 10.0
    cost = np.floor(cost_s / unit_s * (1.0 + 1e-12)).astype(np.int64)  # a whole number of units is not rounded down
    banned = np.zeros(cost.shape, dtype=np.bool_)
    for a, b in forbidden:
        banned[a, b] = banned[b, a] = True
    return TourInstance(cost, unit_s, banned)
