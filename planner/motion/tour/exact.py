"""The solver that is always there: a local search for the tour, linear and integer programs for the proof.

The linear relaxation (degree equations, and the inequalities of :mod:`.cuts` that its points violate) bounds every
tour from below. Legs whose reduced cost exceeds what is left to the best tour are then struck out, and HiGHS solves the
integer program over the few that remain, with subtour inequalities added as its answers violate them (Dantzig,
Fulkerson and Johnson, Operations Research 2, 1954). Limits are counts of nodes, never seconds.

Inequalities that every tour keeps and points of a relaxation violate: subtours and blossoms.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import highspy
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.quiet import quiet_output
from planner.common.units import Array, IntArray
from planner.motion.tour.instance import TourInstance
from planner.motion.tour.local_search import LocalSearch, greedy_tour, nearest_neighbours, walk_tour

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Cut:
    """An inequality over the legs that leave a node set.

    A tour leaves it at least twice. It leaves it an even number of times, too, so that of an odd number of these legs
    (``teeth``) it leaves at least one out, or takes at least one of the others: the blossoms of Edmonds, Journal of
    Research of the National Bureau of Standards 69B (1965).

    Attributes:
        side: the node set, (m,), node 0 outside.
        teeth: legs that leave it (t, 2), the smaller node first, an odd number; none for a subtour inequality.
    """

    side: BoolArray
    teeth: IntArray

    @classmethod
    def of(cls, side: BoolArray, teeth: IntArray | None = None) -> "Cut":
        """Return the cut of a node set or of the nodes outside it: both are the same."""
        return cls(~side if side[0] else side, np.zeros((0, 2), dtype=np.int64) if teeth is None else teeth)

    @property
    def least(self) -> int:
        """Smallest sum of the legs' use, each by its factor."""
        return 1 - len(self.teeth) if len(self.teeth) else 2

    @cached_property
    def key(self) -> bytes:
        """The same for the same inequality alone."""
        return self.side.tobytes() + self.teeth.tobytes()

    def factors(self, legs: IntArray) -> Array:
        """Return the factors of legs (k, 2), the smaller node first: 1 where they leave the set, −1 of teeth, (k,)."""
        size = len(self.side)
        out: Array = (self.side[legs[:, 0]] != self.side[legs[:, 1]]).astype(float)
        out[np.isin(legs @ (size, 1), self.teeth @ (size, 1))] = -1.0
        return out


def violated_sets(x: Array) -> list[BoolArray]:
    """Return node sets that ``x`` (m, m, degrees 2) leaves less than twice: unconnected parts, or minimum cuts.

    Stoer and Wagner, J. ACM 44 (1997), after contracting legs at 1: no cut below 2 separates their ends.
    """
    parts = connected_sets(x > 1e-9)
    if len(parts) > 1:
        return parts
    member = np.array(connected_sets(x > 1.0 - 1e-9))
    label = member.argmax(axis=0)
    tail, head = np.nonzero(x)
    weight = np.zeros((len(member), len(member)))
    np.add.at(weight, (label[tail], label[head]), x[tail, head])  # not a matrix product: the same on every machine
    np.fill_diagonal(weight, 0.0)
    found = []
    missed = 1e-3  # by which an inequality must be missed to be worth a row
    while len(weight) > 1:
        last, before, value = _cut_of_phase(weight)
        if value < 2.0 - missed:
            found.append(member[last])
        weight[before] += weight[last]
        weight[:, before] += weight[:, last]
        weight[before, before] = 0.0
        member[before] |= member[last]
        keep = np.arange(len(weight)) != last
        weight, member = weight[np.ix_(keep, keep)], member[keep]
    return found


def _cut_of_phase(weight: Array) -> tuple[int, int, float]:
    """Maximum adjacency order from node 0: its last node, the one before, and the cut around the last."""
    attached = weight[0].copy()
    attached[0] = -np.inf
    last, before, value = 0, 0, 0.0
    for _ in range(len(weight) - 1):
        before, last = last, int(attached.argmax())
        value = float(attached[last])
        attached += weight[last]
        attached[last] = -np.inf
    return last, before, value


def violated_blossoms(x: Array) -> list[Cut]:
    """Return blossoms that ``x`` (m, m, degrees 2, no subtour violated) misses, not all of them.

    Looked at are the parts that legs hold together whose use is nowhere near 0 or 1 (Padberg and Hong, Mathematical
    Programming Study 12, 1980). Trees of minimum cuts would find all: in ten times
    the time, a tenth more of the gap is closed.
    """
    lacks = np.minimum(x, 1.0 - x)
    # 1e-6, 0.1 …: what a leg lacks at least to hold two nodes together
    return _blossoms(x, [part for least in (1e-6, 0.1, 0.2, 0.3, 0.4) for part in connected_sets(lacks > least)])


def _blossoms(x: Array, sides: list[BoolArray]) -> list[Cut]:
    """Return for each of the node sets (m,) the blossom that ``x`` misses by most, if it misses one."""
    sides = [side for side in sides if np.count_nonzero(side) > 1]
    if not sides:
        return []
    tail, head = np.nonzero(np.triu(x > 0.0, 1))
    use, handles = x[tail, head], np.array(sides)
    leaves = handles[:, tail] != handles[:, head]  # (sets, legs)
    tooth = leaves & (use > 0.5)
    kept = (leaves * np.minimum(use, 1.0 - use)).sum(axis=1)
    # where the number is even, the leg that is nearest to either changes over
    even = np.flatnonzero(np.count_nonzero(tooth, axis=1) % 2 == 0)
    between = np.where(leaves[even], np.abs(1.0 - 2.0 * use), np.inf)
    nearest = between.argmin(axis=1)
    kept[even] += between.min(axis=1)
    tooth[even, nearest] ^= True
    legs = np.column_stack([tail, head])  # 1e-3: as of subtours
    return [Cut.of(sides[k], legs[tooth[k]]) for k in np.flatnonzero(kept < 1.0 - 1e-3)]


def connected_sets(linked: BoolArray) -> list[BoolArray]:
    """Return the connected parts of the graph as node sets (m,)."""
    count, label = connected_components(csr_array(linked), directed=False)
    return [label == k for k in range(count)]


NEIGHBOURS = 6  # of the shortest legs from each node that the relaxation begins with
DUAL_STEPS = 2**14  # steps of a dual value per unit of cost


def initial_search(instance: TourInstance, seed: int, limit: TimeLimit = UNLIMITED) -> LocalSearch:
    """Return a local search that has found a good tour, usually less than a few per cent longer than the best."""
    weight = instance.weigh_legs()
    search = LocalSearch(weight, nearest_neighbours(weight, 8), greedy_tour(weight), seed, limit)  # neighbours
    search.improve(len(weight) // 2)
    return search


def solve_instance(instance: TourInstance, search: LocalSearch, nodes: int) -> tuple[list[int], int]:
    """Return the best tour found from ``search`` on, and the lower bound [units] proven over ``nodes`` of the tree."""
    size, tour = len(instance.cost), list(search.tour)
    near = nearest_neighbours(instance.weigh_legs(), NEIGHBOURS)
    first = np.column_stack([np.repeat(np.arange(size), near.shape[1]), near.ravel()])
    relaxation = Relaxation(instance, instance.length(tour), np.concatenate([first, _legs(tour)]))
    reduced = relaxation.optimize()
    search.neighbours = nearest_neighbours(reduced, NEIGHBOURS)
    length, root = instance.length(tour), relaxation.bound(reduced)
    bound = -(-root // DUAL_STEPS)
    search.improve(2 * size, most=length - bound)
    if instance.length(search.tour) < length:  # of equals the first found
        tour, length = search.tour, instance.length(search.tour)
    if bound >= length or nodes == 0:
        return tour, min(bound, length)
    useful = np.triu(reduced <= (length - 1) * DUAL_STEPS - root, 1) & ~instance.forbidden
    legs, cuts = np.argwhere(useful), relaxation.tight_cuts()
    return _search_tree(instance, tour, legs, cuts, bound, nodes, search.limit)


class _Program:
    """Degree equations and cuts of HiGHS over legs (k, 2), the smaller node first."""

    def __init__(self, instance: TourInstance, scale: float, **options: object) -> None:
        self.size = len(instance.cost)
        self.cost = (instance.cost + instance.penalty * instance.forbidden) / scale
        self.legs: IntArray = np.zeros((0, 2), dtype=np.int64)
        self.cuts: list[Cut] = []
        solver: Any = highspy.Highs  # its Python side carries no types
        with quiet_output():  # since HiGHS 1.16 this prints a banner, before any option can be set
            self.solver = solver()
        for option, value in {"output_flag": False, "threads": 1, "random_seed": 0, **options}.items():
            self.solver.setOptionValue(option, value)
        two, none = np.full(self.size, 2.0), np.empty(0, dtype=np.int32)
        self.solver.addRows(self.size, two, two, 0, np.zeros(self.size, dtype=np.int32), none, np.empty(0))

    def add_legs(self, legs: IntArray) -> bool:
        """Add the legs (k, 2) that are not there yet; return whether there were any."""
        there = np.zeros((self.size, self.size), dtype=np.bool_)
        there[tuple(self.legs.T)] = True
        legs = np.unique(np.sort(legs, axis=1), axis=0)
        legs = legs[~there[tuple(legs.T)]]
        if not len(legs):
            return False
        tail, head = legs.T
        ends = np.zeros((len(legs), self.size))
        ends[np.arange(len(legs)), tail] = ends[np.arange(len(legs)), head] = 1.0
        rows = csr_array(np.hstack([ends, *(cut.factors(legs)[:, None] for cut in self.cuts)]))
        parts = rows.indptr[:-1].astype(np.int32), rows.indices.astype(np.int32), rows.data.astype(float)
        bounds = np.zeros(len(legs)), np.ones(len(legs))
        self.solver.addCols(len(legs), self.cost[tail, head], *bounds, rows.nnz, *parts)
        self.legs = np.concatenate([self.legs, legs])
        return True

    def add_cuts(self, cuts: Iterable[Cut]) -> bool:
        """Demand that a tour keeps these inequalities; return whether one of them was new."""
        known = {c.key for c in self.cuts}
        fresh = [c for c in {c.key: c for c in cuts}.values() if c.key not in known]
        for cut in fresh:
            factors = cut.factors(self.legs)
            used = np.flatnonzero(factors).astype(np.int32)
            self.solver.addRow(cut.least, highspy.kHighsInf, len(used), used, factors[used])
        self.cuts += fresh
        return len(fresh) > 0

    def make_whole(self) -> None:
        """Let every leg be used wholly or not at all."""
        count = len(self.legs)
        whole = np.full(count, highspy.HighsVarType.kInteger)
        self.solver.changeColsIntegrality(count, np.arange(count, dtype=np.int32), whole)

    def start_from(self, tour: list[int]) -> None:
        """Give the solver a tour over legs that it has."""
        used = np.zeros((self.size, self.size))
        tail, head = _legs(tour).T
        used[tail, head] = used[head, tail] = 1.0
        known = highspy.HighsSolution()
        known.col_value = used[tuple(self.legs.T)].tolist()
        self.solver.setSolution(known)

    def point(self) -> Array:
        """Solve; return how much of each leg the solution uses, (m, m)."""
        self.solver.run()
        x = np.zeros((self.size, self.size))
        tail, head = self.legs.T
        x[tail, head] = x[head, tail] = self.solver.getSolution().col_value
        return x


class Relaxation(_Program):
    """The linear relaxation, and bounds from it that hold in exact integer arithmetic.

    The simplex method runs in floating point. Its dual values are rounded to a fixed grid, and any dual values, rounded
    or not, bound every tour from below:  2 sum y + sum over legs of min(0, reduced cost). That sum is in integers.
    """

    def __init__(self, instance: TourInstance, upper: int, legs: IntArray) -> None:
        """Take the instance, the cost of a known tour (it sets the scale of the LP) and the first legs."""
        self._scale = max(1.0, upper / len(instance.cost) / 100.0)  # [units] legs cost about 100 in the LP
        super().__init__(instance, self._scale, presolve="off")
        self.add_legs(legs)

    def optimize(self) -> IntArray:
        """Add violated inequalities and legs of negative reduced cost until there are none.

        Returns:
            The exact reduced cost of every leg, let in or not, (m, m) [1/DUAL_STEPS unit].
        """
        while True:
            while self.add_cuts(self._find_cuts(self.point())):
                pass
            dual = np.rint(np.array(self.solver.getSolution().row_dual) * self._scale * DUAL_STEPS).astype(np.int64)
            dual[self.size :] = np.maximum(dual[self.size :], 0)
            self._dual: IntArray = dual
            reduced = self._reduce_costs()
            if not self.add_legs(np.argwhere(np.triu(reduced < 0, 1))):
                return reduced

    def bound(self, reduced: IntArray) -> int:
        """Return the lower bound over all tours [1/DUAL_STEPS unit]."""
        least = np.array([2] * self.size + [cut.least for cut in self.cuts])
        return int(self._dual @ least) + int(np.minimum(np.triu(reduced, 1), 0).sum())

    def tight_cuts(self) -> list[Cut]:
        """Return the inequalities that hold the bound up."""
        return [cut for cut, price in zip(self.cuts, self._dual[self.size :], strict=True) if price > 0]

    def _find_cuts(self, x: Array) -> list[Cut]:
        """Return cuts that a point misses: those of subtours, and where it misses none, blossoms."""
        return [Cut.of(s) for s in violated_sets(x)] or violated_blossoms(x)

    def _reduce_costs(self) -> IntArray:
        dual = self._dual.astype(float)
        sets = np.array([cut.side for cut in self.cuts], dtype=float).reshape(-1, self.size)
        node, price = dual[: self.size], dual[self.size :]
        once = price @ sets + node
        whole = np.rint(self.cost * self._scale) * DUAL_STEPS  # whole numbers below 2^53: exact
        reduced = whole - once[:, None] - once[None, :] + 2.0 * (sets.T * price) @ sets
        for cut, paid in zip(self.cuts, price, strict=True):
            a, b = cut.teeth.T
            reduced[a, b] += 2.0 * paid
            reduced[b, a] = reduced[a, b]
        return np.asarray(reduced, dtype=np.int64)


def _search_tree(
    instance: TourInstance,
    tour: list[int],
    useful: IntArray,
    cuts: list[Cut],
    bound: int,
    most_nodes: int,
    limit: TimeLimit,
) -> tuple[list[int], int]:
    """Return the shortest tour over the legs (k, 2), ``tour`` where none is shorter, and the proven bound [units]."""
    length, nodes = instance.length(tour), 0
    program = _Program(instance, 1.0, mip_rel_gap=0.0, mip_abs_gap=0.5, mip_heuristic_effort=0.0)  # costs are whole
    program.add_legs(useful)
    allowed = length < instance.penalty
    if allowed:
        program.add_legs(_legs(tour))
    program.add_cuts(cuts)
    program.make_whole()
    while True:
        program.solver.setOptionValue("mip_max_nodes", most_nodes - nodes)
        program.solver.setOptionValue(
            "time_limit", program.solver.getRunTime() + limit.remaining_seconds(LastStart.TOUR)
        )
        if allowed:
            program.start_from(tour)
        x = program.point()
        info, status = program.solver.getInfo(), program.solver.getModelStatus()
        nodes += max(int(info.mip_node_count), 1)
        optimal = status == highspy.HighsModelStatus.kOptimal
        if status == highspy.HighsModelStatus.kInfeasible or (optimal and info.objective_function_value > length - 0.5):
            return tour, length
        parts = connected_sets(x > 0.5)
        if optimal and len(parts) == 1:
            shorter = _cycle(x)
            return shorter, instance.length(shorter)
        if not optimal or nodes >= most_nodes:
            return tour, min(length, max(bound, int(np.ceil(info.mip_dual_bound - 0.5))))
        program.add_cuts([Cut.of(s) for s in parts])


def _legs(tour: list[int]) -> IntArray:
    return np.column_stack([tour, np.roll(tour, -1)])


def _cycle(x: Array) -> list[int]:
    """Read the tour off a point that is one."""
    return walk_tour([np.flatnonzero(row > 0.5).tolist() for row in x], 0)
