"""Poses that are best by the discrimination criterion, and the certified bound on it.

The criterion DT: how well poses tell rivals apart, and, for a smaller part, how well they see everything else.

With M the information of all columns (in the coordinates of :class:`PoolCoordinates`) over the chosen poses, a
noncentrality is the sum of squares that is left of a truth's predicted readings, in noise variances, after the plan's
own parameters and the rival took what they can: det M(own, rival, signal) / det M(own, rival), a Schur complement.

    f(M) = (1 - k) mean over questions of log noncentrality + k / P log det M(own)

is the compound of T- and D-optimality (Atkinson 2008, J. Stat. Plan. Inference 138: DT-optimum designs; T: Atkinson and
Fedorov 1975, Biometrika 62). It is a sum of log determinants of blocks T'MT, with weights a of both signs, and concave,
since a Schur complement is concave and grows with M. It grows by log c when M grows c-fold, so that for any M*

    f(M) <= f(M*) + log <X, M>,   X = sum of a T (T'M*T)^-1 T',   <X, M*> = 1:  the certificate.

M stands with a trace of the pool's own information (``INFORMATION_RIDGE``), so that poses that miss a
question have a value too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.common.determinism import Positions, round_significant
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array
from planner.design.assumptions import INFORMATION_RIDGE, INFORMATION_SHARE, SPAN_SHARE, UNSEEN_SHARE
from planner.design.observability.information import r_factor
from planner.design.selection.certificate import ActiveSet, Certificate, Dual, Pricing, generate_columns
from planner.design.selection.interior_point import solve_interior_point
from planner.design.selection.matrix_forms import (
    information_matrix,
    pairwise_form,
    project_semidefinite,
    quadratic_form,
    sum_largest,
    swap_log_ratios,
)
from planner.design.selection.relaxation import ConcaveProblem
from planner.design.selection.search import Swap, descend, highest_priced_candidates, order_by_weight, search_starts


@dataclass(frozen=True)
class PoolCoordinates:
    """Coordinates of the columns in which the information of the whole pool is one, so that all is well conditioned.

    Attributes:
        to: (P, p): rows of the pool times it have the information one.
        columns: (p, P): where each column lies.
    """

    to: Array
    columns: Array

    @classmethod
    def of(cls, rows: Array) -> "PoolCoordinates":
        """Take the coordinates from the rows (n, r, P) of the whole pool."""
        size = np.maximum(np.linalg.norm(rows.reshape(-1, rows.shape[2]), axis=0), 1e-300)
        _, mu, axes = np.linalg.svd(r_factor(rows / size))
        seen = mu > UNSEEN_SHARE * mu[0]
        return cls((axes[seen].T / mu[seen]) / size[:, None], mu[seen, None] * axes[seen] * size)

    def rows(self, rows: Array) -> Array:
        """Rows (n, r, P) in the new coordinates, (n, r, p)."""
        return np.asarray(rows @ self.to)

    def span(self, which: np.ndarray) -> Array:
        """Orthonormal basis (p, k) of what some columns span."""
        return orthonormal_span(self.columns[:, which], SPAN_SHARE)


def orthonormal_span(columns: Array, least: float) -> Array:
    """Orthonormal basis (m, p) of what columns (m, P) span above ``least`` of the largest singular value."""
    size = np.linalg.norm(columns, axis=0)
    out, mu, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(out[:, mu > least * mu[0]])


@dataclass(frozen=True)
class DiscriminationQuestion:
    """Would readings of a truth be taken for another effect?

    Attributes:
        truth: its name.
        shows: columns of the parameters by which the truth shows, (k,) ints, and their ``values``.
        base: columns that are in the model anyway, (p,) ints; ``rival`` those of the other effect.
    """

    truth: str
    shows: np.ndarray
    values: Array
    base: np.ndarray
    rival: np.ndarray

    @property
    def alternatives(self) -> np.ndarray:
        """Columns that may explain the truth otherwise."""
        return np.union1d(self.base, self.rival)


@dataclass(frozen=True)
class LogDetTerm:
    """``weight`` times log det T'MT; ``basis`` T (p, k), orthonormal."""

    weight: float
    basis: Array

    def of(self, mass: Array) -> Array:
        """Return Tᵀ M T, (k, k)."""
        return np.asarray(self.basis.T @ mass @ self.basis + INFORMATION_RIDGE * np.eye(self.basis.shape[1]))


@dataclass(frozen=True)
class DTCriterion:
    """A sum of log determinants; ``cap_factor`` and ``logarithmic`` as in the relaxation of pose selection."""

    terms: tuple[LogDetTerm, ...]
    cap_factor: float = 1.0
    logarithmic: bool = True

    def value(self, mass: Array) -> float:
        """The criterion at information ``mass`` (p, p)."""
        return float(sum(term.weight * np.linalg.slogdet(term.of(mass))[1] for term in self.terms))

    def slope(self, mass: Array) -> Array:
        """Its derivative X (p, p)."""
        out = np.asarray(sum(weight * inverse for weight, inverse in self._inverses(mass)))
        return np.asarray((out + out.T) / 2)

    def curvature(self, rows: Array, mass: Array) -> Array:
        """Minus its second derivative by the weights of ``rows`` (n, r, p), (n, n)."""
        return np.asarray(sum(weight * pairwise_form(rows, inv, inv) for weight, inv in self._inverses(mass)))

    def swap_gains(self, inner: Array, outer: Array, mass: Array) -> Array:
        """Exact change, (n, m), when each of ``outer`` (m, r, p) takes the place of one of ``inner`` (n, r, p)."""
        return np.asarray(sum(weight * swap_log_ratios(inner, outer, inv) for weight, inv in self._inverses(mass)))

    def _inverses(self, mass: Array) -> list[tuple[float, Array]]:
        """Weight and T (T'MT)^-1 T' (p, p) of each term."""
        return [(t.weight, t.basis @ np.linalg.solve(t.of(mass), t.basis.T)) for t in self.terms]


def noncentrality(
    frame: PoolCoordinates, mass: Array, question: DiscriminationQuestion, beside: bool = True
) -> tuple[float, Array]:
    """Noncentrality at information ``mass`` (p, p), and the direction (p,) in which the truth shows beyond the other.

    ``beside`` the other effect, else beside the model alone.
    """
    basis = frame.span(question.alternatives if beside else question.base)
    signal = frame.columns[:, question.shows] @ question.values
    fit = basis @ (np.linalg.pinv(basis.T @ mass @ basis, rcond=1e-13, hermitian=True) @ (basis.T @ (mass @ signal)))
    left = signal - fit
    return max(0.0, float(left @ mass @ left)), left


def dt_criterion(
    frame: PoolCoordinates, own: np.ndarray, questions: Sequence[DiscriminationQuestion], weights: Array
) -> DTCriterion:
    """Return the criterion for questions of some weights; ``own``: columns of the plan's own parameters."""
    basis = frame.span(own)
    terms = [LogDetTerm(INFORMATION_SHARE / basis.shape[1], basis)]
    for question, share in zip(questions, weights * ((1.0 - INFORMATION_SHARE) / weights.sum()), strict=True):
        others = frame.span(question.alternatives)
        signal = frame.columns[:, question.shows] @ question.values
        left = signal - others @ (others.T @ signal)
        terms.append(LogDetTerm(float(share), np.column_stack([others, left / np.linalg.norm(left)])))
        terms.append(LogDetTerm(-float(share), others))
    return DTCriterion(tuple(terms))


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
