"""The travelling-salesman problem in integers: every wish about the ends becomes one closed tour.

Open ends are joined through a dummy node at no cost; a required leg (start to end, or start to dummy) carries a
bonus that no tour can afford to miss, a forbidden leg a penalty that no tour pays unless it must.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.units import Array

IntArray = NDArray[np.int64]

_FINEST = 1e-6  # [s] one unit of the integer costs, unless the range demands a coarser one
_LARGEST_TOUR = 10**9  # [units] so that a tour and a forbidden leg fit in Concorde's 32 bits


@dataclass(frozen=True)
class Instance:
    """A symmetric closed tour over m nodes, m = n or n + 1 with the dummy node last.

    Attributes:
        cost: (m, m) integer costs in units of ``unit_s``, rounded down, without bonus or penalty.
        unit_s: [s] what one unit stands for.
        n: number of real nodes.
        required: the leg that the closed tour must contain, if any.
        forbidden: (m, m) bool, legs that no tour may use.

    """

    cost: IntArray
    unit_s: float
    n: int
    required: tuple[int, int] | None
    forbidden: NDArray[np.bool_]

    @property
    def penalty(self) -> int:
        """Cost added to a forbidden leg: more than any tour costs [units]."""
        return int(self.cost.max(axis=1).sum()) + 1

    @property
    def bonus(self) -> int:
        """Cost taken off the required leg: more than any tour costs with all its penalties [units]."""
        return (len(self.cost) + 1) * self.penalty

    def weighted(self) -> IntArray:
        """Return (m, m) costs with penalties on forbidden legs and the bonus on the required one."""
        cost = self.cost + self.penalty * self.forbidden
        if self.required is not None:
            a, b = self.required
            cost[a, b] = cost[b, a] = -self.bonus
        return cost

    def length(self, cycle: list[int]) -> int:
        """Return the closed tour's cost with penalties, the required leg at its own cost [units]."""
        legs = (np.array(cycle), np.roll(cycle, -1))
        return int(self.cost[legs].sum()) + self.penalty * int(self.forbidden[legs].sum())

    def holds_required(self, cycle: list[int]) -> bool:
        """Say whether the closed tour contains the required leg."""
        if self.required is None:
            return True
        a, b = (cycle.index(node) for node in self.required)
        return (a - b) % len(cycle) in (1, len(cycle) - 1)

    def order(self, cycle: list[int]) -> list[int]:
        """Cut the closed tour open at the dummy or the required leg, in either direction."""
        if len(self.cost) > self.n:
            place = cycle.index(self.n)
            return cycle[place + 1 :] + cycle[:place]
        if self.required is None:
            return cycle
        place = cycle.index(self.required[0])
        nodes = cycle[place:] + cycle[:place]
        return [nodes[0], *nodes[:0:-1]] if nodes[1] == self.required[1] else nodes


def build_instance(
    cost_s: Array, start: int | None, end: int | None, forbidden: Collection[tuple[int, int]]
) -> Instance:
    """Turn costs (n, n) [s] and the wishes about ends and legs into a closed problem in integers."""
    n = len(cost_s)
    anchor = end if start is None else start
    joined = start is not None and end is not None
    m = n if joined else n + 1
    unit_s = _FINEST
    while cost_s.max(axis=1).sum() > _LARGEST_TOUR * unit_s:
        unit_s *= 10.0
    cost = np.zeros((m, m), dtype=np.int64)
    cost[:n, :n] = np.floor(cost_s / unit_s * (1.0 + 1e-12))  # a whole number of units is not rounded down
    banned = np.zeros((m, m), dtype=np.bool_)
    for a, b in forbidden:
        banned[a, b] = banned[b, a] = True
    required = None
    if not joined and anchor is not None:
        required = (anchor, n)
    elif start is not None and end is not None and start != end:
        required = (start, end)
    if required is not None:
        a, b = required
        cost[a, b] = cost[b, a] = 0
        banned[a, b] = banned[b, a] = False
    return Instance(cost, unit_s, n, required, banned)
