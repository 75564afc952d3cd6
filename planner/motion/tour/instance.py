"""The leg costs, and the travelling-salesman problem in integers."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.common.errors import InputError
from planner.common.units import Array


def slowest_axis_cost(q: Array, speed: Array) -> Array:
    """Return (n, n) [s]: the time of every leg when its slowest axis sets the pace (EDBB paper, eq. 7).

    Args:
        q: (n, N) joint angles [rad].
        speed: (N,) largest joint speeds [rad/s].

    Raises:
        InputError: shapes that do not match, values that are not finite, or speeds that are not positive.

    """
    q, speed = np.asarray(q, dtype=float), np.asarray(speed, dtype=float)
    if q.ndim != 2 or speed.shape != q.shape[1:]:
        raise InputError(f"leg costs need joint angles (n, N) and N speeds; found shapes {q.shape} and {speed.shape}")
    if not np.isfinite(q).all():
        raise InputError("leg costs need finite joint angles; found NaN or infinity")
    if not (np.isfinite(speed).all() and (speed > 0.0).all()):
        raise InputError(f"joint speeds must be positive; found {speed.tolist()} rad/s")
    slowest = np.zeros((len(q), len(q)))
    for axis in range(len(speed)):
        travel = np.abs(q[:, None, axis] - q[None, :, axis])  # [rad]
        np.maximum(slowest, travel / speed[axis], out=slowest)
    return slowest


def check_costs(cost_s: Array) -> Array:
    """Return the costs as an (n, n) float array with a zero diagonal, or say what is wrong with them."""
    cost = np.array(cost_s, dtype=float)
    if cost.ndim != 2 or cost.shape[0] != cost.shape[1] or len(cost) == 0:
        raise InputError(f"a tour needs a square matrix of leg costs for one pose or more; found shape {cost.shape}")
    np.fill_diagonal(cost, 0.0)
    if not np.isfinite(cost).all():
        a, b = np.argwhere(~np.isfinite(cost))[0]
        raise InputError(f"leg costs must be finite; found {cost[a, b]} from pose {a} to pose {b}")
    if (cost < 0.0).any():
        a, b = np.argwhere(cost < 0.0)[0]
        raise InputError(f"leg costs must not be negative; found {cost[a, b]:g} s from pose {a} to pose {b}")
    uneven = np.abs(cost - cost.T) > 1e-9 * cost.max(initial=0.0)
    if uneven.any():
        a, b = np.argwhere(uneven)[0]
        raise InputError(
            f"leg costs must be the same both ways; found {cost[a, b]:g} s from pose {a} to pose {b} "
            f"and {cost[b, a]:g} s back"
        )
    return np.asarray((cost + cost.T) / 2.0)


IntArray = NDArray[np.int64]

_FINEST = 1e-6  # [s] one unit of the integer costs, unless the range demands a coarser one
_LARGEST_TOUR = 10**9  # [units] so that a tour and a forbidden leg fit in Concorde's 32 bits


@dataclass(frozen=True)
class TourInstance:
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

    def weigh_legs(self) -> IntArray:
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
) -> TourInstance:
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
    return TourInstance(cost, unit_s, n, required, banned)
