"""The order in which the poses are visited, with the proof of how good it is."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from planner.common.errors import InputError, MissingProgramError, NoSolutionError
from planner.common.time_limit import TOUR, must_stop
from planner.common.units import Array
from planner.motion.tour.concorde import ConcordeError, find_concorde, solve_concorde
from planner.motion.tour.exact import initial_search, solve_embedded
from planner.motion.tour.instance import IntArray, TourInstance, build_instance, check_costs


def shortest_order(cost_s: Array, start: int | None, end: int | None) -> tuple[list[int], float]:
    """Return the best order of all n nodes and its cost [s]; infinite where forbidden legs leave none.

    ``cost_s`` is (n, n), forbidden legs infinite; equal ends close the tour, None leaves an end free.
    """
    n = len(cost_s)
    best = np.full((2**n, n), np.inf)
    for node in range(n) if start is None else [start]:
        best[1 << node, node] = 0.0
    for visited in range(1, 2**n):
        if not np.isfinite(best[visited]).any():
            continue
        arrival = (best[visited][:, None] + cost_s).min(axis=0)
        for node in range(n):
            if not visited >> node & 1:
                best[visited | 1 << node, node] = arrival[node]
    closing = np.zeros(n)
    if end is not None:
        closing = cost_s[:, end].copy() if start == end else np.where(np.arange(n) == end, 0.0, np.inf)
    if n == 1:
        closing[:] = 0.0
    visited, total = 2**n - 1, best[-1] + closing
    order = [int(total.argmin())]
    while len(order) < n:
        before = visited & ~(1 << order[-1])
        order.append(int((best[before] + cost_s[:, order[-1]]).argmin()))
        visited = before
    return order[::-1], float(total.min())


_FEW = 12  # nodes up to which dynamic programming is quicker than everything else

Method = Literal["auto", "exact", "concorde"]


@dataclass(frozen=True)
class Tour:
    """An order of visit and its certificate.

    Attributes:
        order: (n,) int, read-only: every node once, first to last.
        closed: whether the last leg leads back to the first node.
        unsorted_s: [s] cost of visiting in the order given (start first, end last).
        cost_s: [s] cost of this order.
        lower_bound_s: [s] proven: no order costs less.
        optimal: whether the proof is complete. It is made on costs rounded down to whole units (1 us, coarser
            only beyond 1000 s of legs), so that ``cost_s - lower_bound_s`` may still show that rounding, n units.
        solver: "embedded", "dynamic-programming" or "concorde".
        notes: what the person should know about how it was found.

    """

    order: IntArray
    closed: bool
    unsorted_s: float
    cost_s: float
    lower_bound_s: float
    optimal: bool
    solver: str
    notes: tuple[str, ...] = ()

    @property
    def gap(self) -> float:
        """``cost_s / lower_bound_s - 1``."""
        return self.cost_s / self.lower_bound_s - 1.0 if self.lower_bound_s > 0.0 else 0.0


def solve_tour(
    cost_s: Array,
    *,
    start: int | None = None,
    end: int | None = None,
    forbidden: Collection[tuple[int, int]] = (),
    method: Method = "auto",
    seed: int = 0,
    nodes: int | None = None,
) -> Tour:
    """Find the cheapest order to visit all nodes, and prove it.

    Args:
        cost_s: (n, n) symmetric leg costs [s]; the diagonal is not used.
        start: node to begin with; equal to ``end`` closes the tour.
        end: node to end with; an end that is not given is free.
        forbidden: legs (a, b) that must not be used, in neither direction.
        method: "exact" is the embedded solver, "concorde" asks for Concorde, "auto" takes it where it is found.
        seed: of the local search and of Concorde.
        nodes: of the embedded solver's search tree at most; 0 proves what the root proves, which many poses take a
            minute less for. By default as many as a proof usually takes, and more.

    Raises:
        InputError: costs that are not square, symmetric, finite and non-negative, or nodes that do not exist.
        NoSolutionError: no order avoids the forbidden legs.
        MissingProgramError: Concorde was asked for and is not there.

    """
    cost = check_costs(cost_s)
    _check_request(len(cost), start, end, forbidden, method)
    request = _TourRequest(cost, start, end, frozenset(forbidden), method, seed, nodes)
    return request.by_dynamic_programming() if len(cost) <= _FEW else request.by_search()


@dataclass(frozen=True)
class _TourRequest:
    """What was asked for, checked."""

    cost_s: Array
    start: int | None
    end: int | None
    forbidden: frozenset[tuple[int, int]]
    method: Method
    seed: int
    nodes: int | None = None

    @property
    def closed(self) -> bool:
        """Whether the tour ends where it starts."""
        return self.start is not None and self.start == self.end

    def by_dynamic_programming(self) -> Tour:
        """Solve by dynamic programming, on the costs as they are."""
        notes: tuple[str, ...] = ()
        if self.method == "concorde":
            require_concorde()
            notes = (f"Concorde was not needed: {_FEW} poses or fewer are solved by dynamic programming",)
        cost = self.cost_s.copy()
        for a, b in self.forbidden:
            cost[a, b] = cost[b, a] = np.inf
        order, total = shortest_order(cost, self.start, self.end)
        if not np.isfinite(total):
            raise self._no_order_error(proven=True)
        return self._tour(order, total, True, "dynamic-programming", notes)

    def by_search(self) -> Tour:
        """Solve by Concorde where wanted and possible, else by the embedded solver."""
        instance = build_instance(self.cost_s, self.start, self.end, self.forbidden)
        search = initial_search(instance, self.seed)
        upper = instance.length(search.tour)
        notes: tuple[str, ...] = ()
        if self.method != "exact":
            try:
                tour = self._by_concorde(instance, upper)
            except ConcordeError as error:
                notes = (f"{error}; the embedded solver took over",)
            else:
                if tour is not None:
                    return tour
        cut = must_stop(TOUR, "of the proof that the tour is the shortest only the root was computed")
        nodes = 0 if cut else self.nodes
        found = solve_embedded(instance, search, nodes)
        length = instance.length(found.tour)
        if length >= instance.penalty:
            raise self._no_order_error(proven=found.bound >= instance.penalty)
        optimal = found.bound >= length
        if not optimal:
            proof = f"after {found.nodes} nodes of branch and cut" if found.nodes else "at the root of branch and cut"
            notes += (f"optimality is not proven {proof}; the gap is a fact",)
        return self._tour(instance.order(found.tour), found.bound * instance.unit_s, optimal, "embedded", notes)

    def _by_concorde(self, instance: TourInstance, upper: int) -> Tour | None:
        """Return Concorde's tour; None where it is not installed and was not asked for by name."""
        program = require_concorde() if self.method == "concorde" else find_concorde()
        if program is None:
            return None
        if upper >= instance.penalty:
            raise ConcordeError("Concorde was not asked, as no tour without forbidden legs was at hand")
        cycle = solve_concorde(program, instance, upper, self.seed)
        bound_s = instance.length(cycle) * instance.unit_s
        return self._tour(instance.order(cycle), bound_s, True, "concorde", ())

    def _tour(self, order: list[int], bound_s: float, optimal: bool, solver: str, notes: tuple[str, ...]) -> Tour:
        order = _canonical_direction(order, self.start, self.end)
        nodes = np.array(order, dtype=np.int64)
        nodes.setflags(write=False)
        cost = self._cost_of_order(nodes)
        return Tour(
            order=nodes,
            closed=self.closed,
            unsorted_s=self._cost_of_order(self._given_order()),
            cost_s=cost,
            lower_bound_s=min(bound_s, cost),
            optimal=optimal,
            solver=solver,
            notes=notes,
        )

    def _cost_of_order(self, order: IntArray) -> float:
        legs = self.cost_s[order[:-1], order[1:]].sum()
        return float(legs + (self.cost_s[order[-1], order[0]] if self.closed else 0.0))

    def _given_order(self) -> IntArray:
        inner = [node for node in range(len(self.cost_s)) if node not in (self.start, self.end)]
        first = [] if self.start is None else [self.start]
        last = [] if self.end is None or self.closed else [self.end]
        return np.array(first + inner + last, dtype=np.int64)

    def _no_order_error(self, *, proven: bool) -> NoSolutionError:
        verdict = "exists" if proven else "was found"
        return NoSolutionError(
            f"no order of the {len(self.cost_s)} poses {verdict} that avoids the {len(self.forbidden)} forbidden legs; "
            "free an end, allow more room for detours, or leave out a pose that few others can reach"
        )


def _canonical_direction(order: list[int], start: int | None, end: int | None) -> list[int]:
    """Return the one direction, of two that cost the same, that does not depend on how it was found."""
    if start is not None and start == end:
        place = order.index(start)
        order = order[place:] + order[:place]
        return [order[0], *order[:0:-1]] if len(order) > 2 and order[1] > order[-1] else order
    if start is not None:
        return order if order[0] == start else order[::-1]
    if end is not None:
        return order if order[-1] == end else order[::-1]
    return order if order[0] <= order[-1] else order[::-1]


def require_concorde() -> Path:
    """Return Concorde's program.

    Raises:
        MissingProgramError: it is not there.
    """
    try:
        program = find_concorde()
    except ConcordeError as error:
        raise MissingProgramError(f"Concorde was asked for, but {error}") from error
    if program is None:
        raise MissingProgramError(
            "Concorde was asked for, but there is no program of that name on PATH and EDBB_CONCORDE is not set; "
            'the method "exact" needs no other program'
        )
    return program


def _check_request(
    n: int, start: int | None, end: int | None, forbidden: Collection[tuple[int, int]], method: str
) -> None:
    named = [node for node in (start, end) if node is not None] + [node for leg in forbidden for node in leg]
    wrong = [node for node in named if not 0 <= node < n]
    if wrong:
        raise InputError(f"a tour over {n} poses knows the numbers 0 to {n - 1}; found {wrong[0]}")
    if method not in ("auto", "exact", "concorde"):
        raise InputError(f'the tour is solved by "auto", "exact" or "concorde"; found "{method}"')
