"""Poses that are best by the discrimination criterion, and the certified bound on it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.common.determinism import Positions, round_significant
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array
from planner.design.assumptions import INFORMATION_RIDGE
from planner.design.discrimination.criterion import DTCriterion
from planner.design.selection.certificate import ActiveSet, Certificate, Dual, Pricing, generate_columns
from planner.design.selection.interior_point import solve_interior_point
from planner.design.selection.matrix_forms import (
    information_matrix,
    project_semidefinite,
    quadratic_form,
    sum_largest,
)
from planner.design.selection.relaxation import ConcaveProblem
from planner.design.selection.search import Swap, descend, highest_priced_candidates, order_by_weight, search_starts

LEAST_GAIN = 1e-7  # of the criterion [1]: below, a swap is rounding


@dataclass(frozen=True)
class TangentDual:
    """The slope X (p, p) of the criterion at some information, and its value ``at`` that information."""

    X: Array
    at: float
    poses: int
    upper: ClassVar[bool] = True

    def verify(self, rows: Array) -> float:
        """Return the bound that the tangent proves over all candidates."""
        X = project_semidefinite(self.X)
        top = sum_largest(np.maximum(quadratic_form(rows, X), 0.0), self.poses)
        # 1e-9: and the rounding in a sum of products
        return self.at + float(np.log(top + INFORMATION_RIDGE * float(np.trace(X)))) + 1e-9

    def prices(self, rows: Array, active: Positions) -> Array:
        """Return minus <X, J'J> of every candidate, (N,)."""
        return -np.maximum(quadratic_form(rows, project_semidefinite(self.X)), 0.0)


@dataclass(frozen=True)
class DTPricing(Pricing):
    """The relaxation of the criterion ``aim`` over the candidates ``rows`` (N, r, p)."""

    aim: DTCriterion

    def first(self, start: Positions) -> ActiveSet:
        """A choice, and what the whole pool prices best."""
        price = quadratic_form(self.rows, self.aim.slope(np.eye(self.rows.shape[2])))
        active = np.union1d(highest_priced_candidates(price, self._width), start)
        weights = np.full(len(active), 0.1)
        weights[np.searchsorted(active, start)] += 1.0
        return ActiveSet(active, weights)

    @property
    def _width(self) -> int:
        return max(400, 3 * self.count)  # candidates at first

    def solve(self, state: ActiveSet, accuracy: float) -> tuple[ActiveSet, Dual, float]:
        """Solve on the active candidates; weights sum to the number of poses."""
        capped = len(state.active) > self.count
        problem = ConcaveProblem(self.rows[state.active], self.count, capped, self.aim)
        z, _ = solve_interior_point(problem, problem.start(state.weights), accuracy, self.limit)
        weights = z * (self.count / np.sum(z))
        mass = problem.mass(weights)
        dual = TangentDual(self.aim.slope(mass), self.aim.value(mass), self.count)
        return ActiveSet(state.active, weights), dual, dual.at

    def distance(self, relaxed: float, bound: float) -> float:
        """Distance to the bound, in the logarithm."""
        return bound - relaxed

    def grow(self, state: ActiveSet, dual: Dual) -> ActiveSet | None:
        """Keep those with weight and the best priced ones; bring in others that are priced better than the limit."""
        price = -dual.prices(self.rows, state.active)
        limit = -np.partition(-price[state.active], self.count - 1)[self.count - 1]
        # 150: candidates that come in each round
        new = np.setdiff1d(highest_priced_candidates(np.where(price > limit, price, 0.0), 150), state.active)
        if len(new) == 0 or len(state.active) >= len(self.rows):
            return None
        kept = np.union1d(state.active[state.weights > 1e-4], highest_priced_candidates(price, self._width))
        known = dict(zip(state.active.tolist(), state.weights.tolist(), strict=True))
        active = np.union1d(kept, new)
        return ActiveSet(active, np.array([known.get(int(k), 1e-3) for k in active]))


def bound_criterion(
    rows: Array, aim: DTCriterion, poses: int, start: Positions, limit: TimeLimit = UNLIMITED
) -> Certificate:
    """Return a bound on the criterion of any ``poses`` of the candidates ``rows`` (N, r, p); ``start``: a choice."""
    tolerance = 2e-3  # [1] gap of the bound: finer than a reading can decide
    most_rounds = 25  # of adding candidates; the gap that is left is told
    pricing = DTPricing(rows, poses, "DT", limit, aim)
    return generate_columns(pricing, pricing.first(start), tolerance, tolerance / 3, most_rounds)


@dataclass(frozen=True)
class DTSwaps:
    """Swaps between the candidates ``rows`` (N, r, p); of those of one ``group`` (N,) only one is chosen."""

    rows: Array
    aim: DTCriterion
    group: Positions

    def best_swap(self, chosen: Positions, outside: Positions) -> Swap | None:
        """Return the swap that betters the criterion most, or None."""
        rows, group = self.rows, self.group
        mass = information_matrix(rows[chosen])
        price = round_significant(quadratic_form(rows[outside], self.aim.slope(mass)))
        likely = outside[np.lexsort((outside, -price))[:96]]  # best prices: these are tried exactly
        near = np.union1d(likely, outside[np.isin(group[outside], group[chosen])])
        if len(near) == 0:
            return None
        gains = self.aim.swap_gains(rows[chosen], rows[near], mass)
        gains[np.isin(group[near], group[chosen]) & (group[chosen][:, None] != group[near])] = -np.inf
        out, into = np.unravel_index(int(np.argmax(round_significant(gains))), gains.shape)
        return Swap(int(out), int(near[into])) if gains[out, into] >= LEAST_GAIN else None


def exchange_by_criterion(
    rows: Array,
    aim: DTCriterion,
    bound: Certificate,
    start: Positions,
    seed: int,
    group: Positions,
    limit: TimeLimit = UNLIMITED,
) -> Positions:
    """Return the best set of as many candidates as ``start`` has, ascending.

    Starts from the relaxation's heaviest candidates, from some drawn by their weights, and from ``start``.
    """
    drawn_starts = 3  # from the relaxation and from draws by its weights; one more is the given start

    def search(turn: int) -> tuple[Positions, float] | None:
        """Return the set of one start and its value; ``None`` where the start has too few."""
        chosen = start
        if turn < drawn_starts:
            order = order_by_weight(bound.support, np.maximum(bound.weights, 1e-12), seed, turn)
            first = np.sort(np.unique(group[order], return_index=True)[1])  # one of a group
            chosen = np.sort(order[first[: len(start)]])
        if len(chosen) < len(start):
            return None
        chosen = descend(DTSwaps(rows, aim, group), chosen, np.arange(len(rows)), limit)
        return chosen, aim.value(information_matrix(rows[chosen]))

    return search_starts(search, range(drawn_starts + 1), lambda value, than: value > than + LEAST_GAIN)[0]
