"""The linear relaxation over some of the legs, and bounds from it that hold in exact integer arithmetic.

The simplex method runs in floating point; its dual values are rounded to a fixed grid, and any dual values, rounded
or not, bound every tour from below:  sum rhs*y + sum over legs of min(0, reduced cost). That sum is taken in integers.
"""

from typing import Any

import highspy
import numpy as np

from planner.common.units import Array
from planner.motion.tour.cuts import Cut
from planner.motion.tour.instance import IntArray, TourInstance

GRID = 2**14  # steps of a dual value per unit of cost
_IDLE_ROUNDS = 15  # a cut without a dual value for that many solves leaves the relaxation


class Relaxation:
    """Degree equations, cuts and the legs that have been let in; ``x`` and ``reduced`` are of the last solve."""

    def __init__(self, instance: TourInstance, upper: int, legs: list[tuple[int, int]]) -> None:
        """Take the instance, the cost of a known tour (it sets the scale of the LP) and the first legs."""
        self.cost = instance.cost + instance.penalty * instance.forbidden
        self.required = instance.required
        self.size = len(self.cost)
        self._scale = max(1.0, upper / self.size / 100.0)  # [units] legs cost about 100 in the LP
        self.cuts: list[Cut] = []
        self._sides: dict[bytes, int] = {}  # cuts bound tighter in the present branch: the crossings there
        self.held: set[bytes] = set()  # cuts that branches refer to: they stay
        self._idle: list[int] = []
        self._known: set[bytes] = set()
        solver: Any = highspy.Highs  # its Python side carries no types
        self._solver = solver()
        for option, value in (("output_flag", False), ("threads", 1), ("random_seed", 0), ("presolve", "off")):
            self._solver.setOptionValue(option, value)
        self.tail = np.empty(0, dtype=np.int64)
        self.head = np.empty(0, dtype=np.int64)
        self.lower = np.empty(0)
        self.upper = np.empty(0)
        none, flat = np.empty(0, dtype=np.int32), np.empty(0)
        two = np.full(self.size, 2.0)
        self._solver.addRows(self.size, two, two, 0, np.zeros(self.size, dtype=np.int32), none, flat)
        self.add_legs(np.array(sorted({(min(leg), max(leg)) for leg in legs}), dtype=np.int64))
        self.x = np.zeros((self.size, self.size))
        self.values = np.zeros(len(self.tail))
        self._dual: IntArray = np.zeros(self.size, dtype=np.int64)

    def add_legs(self, legs: IntArray) -> None:
        """Let the legs (k, 2), smaller node first, into the relaxation."""
        tail, head = legs[:, 0], legs[:, 1]
        rows, starts, values = [], [], []
        length = 0
        coefficients = self._crossings(tail, head)
        for column in range(len(legs)):
            crossed = np.flatnonzero(coefficients[:, column])
            starts.append(length)
            rows.append(np.concatenate((legs[column], self.size + crossed)))
            values.append(np.concatenate(([1.0, 1.0], coefficients[crossed, column])))
            length += len(rows[-1])
        required = np.array(
            [self.required is not None and tuple(leg) in (self.required, self.required[::-1]) for leg in legs]
        )
        lower = required.astype(float)
        upper = np.ones(len(legs))
        cost = self.cost[tail, head] / self._scale
        self._solver.addCols(
            len(legs),
            cost,
            lower,
            upper,
            length,
            np.array(starts, dtype=np.int32),
            np.concatenate(rows).astype(np.int32),
            np.concatenate(values),
        )
        self.tail, self.head = np.concatenate((self.tail, tail)), np.concatenate((self.head, head))
        self.lower, self.upper = np.concatenate((self.lower, lower)), np.concatenate((self.upper, upper))

    def _crossings(self, tail: IntArray, head: IntArray) -> Array:
        """Return (cuts, legs): how many sets of each cut each leg crosses."""
        if not self.cuts:
            return np.zeros((0, len(tail)))
        return np.array([(cut.sets[:, tail] != cut.sets[:, head]).sum(axis=0) for cut in self.cuts], dtype=float)

    def add_cuts(self, cuts: list[Cut]) -> int:
        """Append the cuts that are not there yet; return how many."""
        fresh = [cut for cut in cuts if cut.key not in self._known]
        for cut in fresh:
            self._known.add(cut.key)
            crossed = (cut.sets[:, self.tail] != cut.sets[:, self.head]).sum(axis=0)
            where = np.flatnonzero(crossed)
            self._solver.addRow(
                float(cut.rhs), highspy.kHighsInf, len(where), where.astype(np.int32), crossed[where].astype(float)
            )
        self.cuts += fresh
        self._idle += [0] * len(fresh)
        return len(fresh)

    def drop_idle_cuts(self) -> None:
        """Take out cuts that have not mattered for a while."""
        stale = [k for k, idle in enumerate(self._idle) if idle > _IDLE_ROUNDS and self.cuts[k].key not in self.held]
        if not stale:
            return
        self._solver.deleteRows(len(stale), np.array(stale, dtype=np.int32) + self.size)
        gone = set(stale)
        for k in stale:
            self._known.discard(self.cuts[k].key)
        self.cuts = [cut for k, cut in enumerate(self.cuts) if k not in gone]
        self._idle = [idle for k, idle in enumerate(self._idle) if k not in gone]
        self._dual = np.delete(self._dual, self.size + np.array(stale))

    def drop_legs(self, keep: np.ndarray) -> None:
        """Keep only the legs where ``keep`` (legs,) is true."""
        gone = np.flatnonzero(~keep).astype(np.int32)
        self._solver.deleteCols(len(gone), gone)
        self.tail, self.head = self.tail[keep], self.head[keep]
        self.lower, self.upper, self.values = self.lower[keep], self.upper[keep], self.values[keep]

    def bound_legs(self, lower: Array, upper: Array) -> None:
        """Set the bounds (legs,) of the variables."""
        changed = np.flatnonzero((lower != self.lower) | (upper != self.upper))
        self._solver.changeColsBounds(len(changed), changed.astype(np.int32), lower[changed], upper[changed])
        self.lower, self.upper = lower.copy(), upper.copy()

    def bound_cuts(self, crossings: dict[bytes, int]) -> None:
        """Demand of these sets: 2, left and entered just once; 4, more than once; all others as they are."""
        rows = {cut.key: self.size + k for k, cut in enumerate(self.cuts)}
        for key in self._sides.keys() - crossings.keys():
            self._solver.changeRowBounds(rows[key], 2.0, highspy.kHighsInf)
        for key, count in crossings.items():
            self._solver.changeRowBounds(rows[key], float(count), 2.0 if count == 2 else highspy.kHighsInf)
        self._sides = dict(crossings)

    def solve(self, iterations: int | None = None) -> bool:
        """Solve; return whether there is a point at all (False: the bounds contradict each other)."""
        self._solver.setOptionValue("simplex_iteration_limit", 2**31 - 1 if iterations is None else iterations)
        self._solver.run()
        solution = self._solver.getSolution()
        if self._solver.getModelStatus() == highspy.HighsModelStatus.kInfeasible:
            return False
        self.values = np.array(solution.col_value)
        self.x[:] = 0.0
        self.x[self.tail, self.head] = self.x[self.head, self.tail] = self.values
        dual = np.array(solution.row_dual) * self._scale * GRID
        self._dual = np.rint(dual).astype(np.int64)
        self._clip(self._dual)
        self._idle = [
            0 if used != 0 else idle + 1 for idle, used in zip(self._idle, self._dual[self.size :], strict=True)
        ]
        return True

    def objective(self) -> float:
        """Return the cost of the last point [units], in floating point: a guide, not a proof."""
        return float((self.values * self.cost[self.tail, self.head]).sum())

    def reduced(self) -> IntArray:
        """Return (m, m): the exact reduced cost of every leg, let in or not [1/GRID unit]."""
        return self._reduced(self._dual, GRID)

    def _reduced(self, dual: IntArray, grid: int) -> IntArray:
        node = dual[: self.size].astype(float)
        matrix = self.cost * float(grid) - node[:, None] - node[None, :]
        used = np.flatnonzero(dual[self.size :])
        if len(used):
            sets = np.concatenate([self.cuts[k].sets for k in used]).astype(float)
            price = np.repeat(dual[self.size + used].astype(float), [len(self.cuts[k].sets) for k in used])
            once = price @ sets
            matrix -= once[:, None] + once[None, :] - 2.0 * (sets.T * price) @ sets  # whole, below 2^53: exact
        return np.asarray(matrix, dtype=np.int64)

    def _clip(self, dual: IntArray) -> None:
        """Allow no dual value below 0 but where a cut is bound from above too."""
        for k, cut in enumerate(self.cuts):
            if dual[self.size + k] < 0 and self._sides.get(cut.key) != 2:
                dual[self.size + k] = 0

    def _constant(self, dual: IntArray) -> int:
        rhs = (self._sides.get(cut.key, cut.rhs) for cut in self.cuts)
        return 2 * int(dual[: self.size].sum()) + sum(count * int(dual[self.size + k]) for k, count in enumerate(rhs))

    def bound_all(self, reduced: IntArray) -> int:
        """Return the lower bound over all tours, any leg allowed [1/GRID unit]."""
        value = self._constant(self._dual) + int(np.minimum(np.triu(reduced, 1), 0).sum())
        return value if self.required is None else value + max(int(reduced[self.required]), 0)

    def bound_here(self, reduced: IntArray) -> int:
        """Return the lower bound over the legs let in, within their present bounds [1/GRID unit]."""
        return self._bound_within(self._dual, reduced)

    def _bound_within(self, dual: IntArray, reduced: IntArray) -> int:
        mine = reduced[self.tail, self.head]
        at = np.where(mine > 0, self.lower, self.upper).astype(np.int64)
        return self._constant(dual) + int((mine * at).sum())

    def proves_empty(self) -> bool:
        """Check in integers that the last, contradictory bounds admit no point (Farkas' lemma)."""
        _, found, ray = self._solver.getDualRay()
        if not found:
            return False
        for sign in (1.0, -1.0):
            dual = np.rint(sign * np.array(ray) / np.abs(ray).max() * 2.0**24).astype(np.int64)
            self._clip(dual)
            if self._bound_within(dual, self._reduced(dual, 0)) > 0:
                return True
        return False
