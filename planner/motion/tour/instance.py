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
    unit_s = _FINEST
    while cost_s.max(axis=1).sum() > _LARGEST_TOUR * unit_s:
        unit_s *= 10.0
    cost = np.floor(cost_s / unit_s * (1.0 + 1e-12)).astype(np.int64)  # a whole number of units is not rounded down
    banned = np.zeros(cost.shape, dtype=np.bool_)
    for a, b in forbidden:
        banned[a, b] = banned[b, a] = True
    return TourInstance(cost, unit_s, banned)
