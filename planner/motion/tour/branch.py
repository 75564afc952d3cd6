"""Branch and cut: proves how short a tour can be."""

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from planner.common.units import Array
from planner.motion.tour.cuts import cut_from_sets, find_clusters, find_cuts, undecided_sets, undecided_unions
from planner.motion.tour.instance import IntArray, TourInstance
from planner.motion.tour.local_search import LocalSearch, greedy_tour, nearest_neighbours
from planner.motion.tour.relaxation import GRID, Relaxation

_FIRST_NEIGHBOURS = 6
_STALLED_ROUNDS = 8  # rounds of cuts that gain less than _GAIN of the gap before branching
_GAIN = 0.02
_CANDIDATES = 8  # legs tried by strong branching
_TRIAL_ITERATIONS = 60
_WHOLE = 1e-6  # a value closer than this to 0 or 1 is not fractional

Choice = tuple[int | bytes, int]  # a leg and its value, or a cut's key and how often its set is left: 2, or 4 and more


@dataclass(frozen=True)
class Outcome:
    """A tour, the proven lower bound [units of cost] and how many nodes of the search tree were opened."""

    tour: list[int]
    bound: int
    nodes: int


class BranchAndCut:
    """Proves how short a tour can be, and finds a shorter one where there is."""

    def __init__(self, instance: TourInstance, search: LocalSearch) -> None:
        self._instance = instance
        self._search = search
        self._size = len(instance.cost)
        self.tour = list(search.tour)
        self.length = instance.length(self.tour)
        legs = [
            (i, int(j)) for i, row in enumerate(nearest_neighbours(instance.weighted(), _FIRST_NEIGHBOURS)) for j in row
        ]
        self._relaxation = Relaxation(instance, self.length, legs + self._legs())
        self._nodes = 0
        self._clusters = find_clusters(instance)

    def run(self, kicks: int, nodes: int) -> Outcome:
        """Bound at the root, improve the tour by what the root has taught, and branch over at most ``nodes`` nodes."""
        relaxation = self._relaxation
        self._root()
        reduced = relaxation.reduced()
        self._search.neighbours = nearest_neighbours(reduced, _FIRST_NEIGHBOURS)
        self._search.improve(kicks)
        self._accept(self._search.tour)
        self._root()
        reduced = relaxation.reduced()
        bound = -(-relaxation.bound_all(reduced) // GRID)
        if bound < self.length:
            self._keep(reduced, relaxation.bound_all(reduced))
            bound = self._branch(bound, nodes)
        return Outcome(self.tour, min(bound, self.length), self._nodes)

    def _legs(self) -> list[tuple[int, int]]:
        return list(zip(self.tour, self.tour[1:] + self.tour[:1], strict=True))

    def _accept(self, tour: list[int]) -> None:
        if len(set(tour)) < self._size:
            return
        length = self._instance.length(tour)
        if length < self.length:
            self.tour, self.length = list(tour), length

    def _root(self) -> None:
        """Cut, then let in every leg with a negative reduced cost, until neither changes anything."""
        relaxation = self._relaxation
        self._add(np.array([sorted(leg) for leg in self._legs()]))
        while True:
            self._cut_loop()
            reduced = relaxation.reduced()
            if not self._add(np.argwhere(np.triu(reduced < 0, 1))):
                return

    def _add(self, legs: IntArray) -> bool:
        """Let in the legs (k, 2) that are not yet."""
        relaxation = self._relaxation
        there = np.zeros((self._size, self._size), dtype=np.bool_)
        there[relaxation.tail, relaxation.head] = True
        fresh = legs[~there[legs[:, 0], legs[:, 1]]]
        if len(fresh):
            relaxation.add_legs(fresh)
        return len(fresh) > 0

    def _keep(self, reduced: IntArray, bound: int) -> None:
        """Hold exactly the legs that a tour shorter than the best known can use, whatever the branch."""
        relaxation = self._relaxation
        useful = np.triu(reduced <= (self.length - 1) * GRID - bound, 1)
        if self._instance.required is not None:
            a, b = sorted(self._instance.required)
            useful[a, b] = True
        relaxation.drop_legs(useful[relaxation.tail, relaxation.head])
        self._add(np.argwhere(useful))

    def _cut_loop(self) -> bool:
        """Solve and cut until nothing is violated or gains stall; return False if no point is left."""
        relaxation = self._relaxation
        before, stalled = -np.inf, 0
        while True:
            if not relaxation.solve():
                return False
            value = relaxation.objective()
            if value >= self.length + 1:
                return True
            stalled = stalled + 1 if value - before < _GAIN * (self.length - value) else 0
            before = max(before, value)
            if stalled >= _STALLED_ROUNDS and len(self._fractional()):
                return True
            if not relaxation.add_cuts(find_cuts(relaxation.x, self.tour, self._clusters)):
                return True
            relaxation.drop_idle_cuts()

    def _fractional(self) -> IntArray:
        values = self._relaxation.values
        return np.flatnonzero((values > _WHOLE) & (values < 1.0 - _WHOLE))

    def _branch(self, bound: int, limit: int) -> int:
        """Search the tree; return the proven lower bound on a tour [units]."""
        relaxation = self._relaxation
        self._base = relaxation.lower.copy(), relaxation.upper.copy()
        heap: list[tuple[int, int, tuple[Choice, ...]]] = [(bound, 0, ())]
        unresolved = self.length
        serial = 0
        while heap and heap[0][0] < self.length and self._nodes < limit:
            bound, _, choices = heappop(heap)
            self._nodes += 1
            self._enter(choices)
            if not self._cut_loop():
                if not relaxation.proves_empty():
                    unresolved = min(unresolved, bound)
                continue
            bound = max(bound, -(-relaxation.bound_here(relaxation.reduced()) // GRID))
            if bound >= self.length:
                continue
            fractional = self._fractional()
            if not len(fractional):
                self._accept(_cycle(relaxation.x))
                unresolved = min(unresolved, bound)
                continue
            for choice in self._choose(fractional, choices):
                serial += 1
                heappush(heap, (bound, -serial, (*choices, choice)))
        return min([unresolved, self.length] + [entry[0] for entry in heap[:1]])

    def _enter(self, choices: tuple[Choice, ...]) -> None:
        """Bind the relaxation to a branch."""
        lower, upper = self._base[0].copy(), self._base[1].copy()
        crossings: dict[bytes, int] = {}
        for what, value in choices:
            if isinstance(what, bytes):
                crossings[what] = value
            else:
                lower[what] = upper[what] = float(value)
        self._relaxation.bound_legs(lower, upper)
        self._relaxation.bound_cuts(crossings)

    def _choose(self, fractional: IntArray, choices: tuple[Choice, ...]) -> tuple[Choice, Choice]:
        """Return the two alternatives that raise the bound most in a few simplex iterations.

        One leg at a time says little where poses come in clusters: the next pose of a cluster is nearly as good.
        There the question is whether the tour visits a cluster once or more often.
        """
        relaxation = self._relaxation
        values, start = relaxation.values[fractional], relaxation.objective()
        nearest = fractional[np.argsort(np.abs(values - 0.5), kind="stable")[:_CANDIDATES]]
        options: list[tuple[Choice, Choice]] = [((int(leg), 1), (int(leg), 0)) for leg in nearest]
        sets = list(self._clusters.sets[undecided_sets(relaxation.x, self._clusters.sets, _CANDIDATES)])
        sets += undecided_unions(relaxation.x, self._clusters.partitions, _CANDIDATES)
        cuts = [cut_from_sets([nodes], 2) for nodes in sets]
        relaxation.add_cuts(cuts)
        options += [((cut.key, 2), (cut.key, 4)) for cut in cuts]
        scores = []
        for option in options:
            gains = []
            for choice in option:
                self._enter((*choices, choice))
                solved = relaxation.solve(_TRIAL_ITERATIONS)
                gains.append(max(relaxation.objective() - start, 1e-6) if solved else float(self.length))
            scores.append(min(gains) * 10.0 + max(gains))
        best = options[int(np.argmax(scores))]
        if isinstance(best[0][0], bytes):
            relaxation.held.add(best[0][0])
        self._enter(choices)
        return best


def _cycle(x: Array) -> list[int]:
    """Read the tour off a point that is one."""
    near = [np.flatnonzero(row > 0.5).tolist() for row in x]
    tour, before = [0], -1
    while len(tour) < len(x):
        here = tour[-1]
        following = near[here][0] if near[here][0] != before else near[here][1]
        before = here
        tour.append(following)
    return tour


_NEIGHBOURS = 8
_WORK = 200_000  # nodes of the search tree times nodes of the tour: 1000 at 200 poses, where a dozen is usual
_LEAST_NODES = 50


def initial_search(instance: TourInstance, seed: int) -> LocalSearch:
    """Return a local search that has come to a good tour, a few per cent at most above the best."""
    weight = instance.weighted()
    search = LocalSearch(weight, nearest_neighbours(weight, _NEIGHBOURS), greedy_tour(weight), seed)
    search.improve(len(weight) // 2)
    return search


def solve_embedded(instance: TourInstance, search: LocalSearch, nodes: int | None = None) -> Outcome:
    """Return the best tour found from ``search`` on, and the lower bound proven for it over ``nodes`` of the tree."""
    size = len(instance.cost)
    limit = max(_LEAST_NODES, _WORK // size) if nodes is None else nodes
    return BranchAndCut(instance, search).run(kicks=2 * size, nodes=limit)
