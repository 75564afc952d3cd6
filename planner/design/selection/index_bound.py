"""The certified bound on an observability index: a dual pair, checked afresh over all candidates.

Each check is a short chain of inequalities that holds for *any* symmetric positive semidefinite X, Y, so a sloppy
solver can only make the bound loose, never wrong. With x_i = <X, J_i'J_i>, y_i = <Y, J_i'J_i> and S any n candidates:

    O2   kappa(S)^2 >= s tr X / tr Y   for the largest s with  sum of the n smallest (y_i - s x_i) >= 0, as
         lmin(S) s tr X <= s sum_S x_i <= sum_S y_i <= lmax(S) tr Y
    O3   lmin(S) <= sum_S x_i / tr X <= (sum of the n largest x_i) / tr X
    O1   det(S)^(1/P) <= (sum of the n largest x_i) / (P det(X)^(1/P))          (arithmetic above geometric mean)
    O5   sum over S of 1/mu >= (tr X^(1/3))^(3/2) / (sum of the n largest x_i)^(1/2)    (Hoelder)
    O4   mu_r^2 / mu_1 = O3 / O2 <= bound(O3) / bound(O2)

For sets of any size the n smallest become each single one (O2, and O1 per pose).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar
from weakref import ref

import numpy as np

from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array, read_only
from planner.design.observability.information import INDEX_RULES, find_rule, index_value
from planner.design.selection.certificate import ActiveSet, Certificate, Dual, Pricing, generate_columns
from planner.design.selection.interior_point import solve_interior_point
from planner.design.selection.matrix_forms import project_semidefinite, quadratic_form, sum_largest
from planner.design.selection.relaxation import (
    ConcaveProblem,
    EigenvalueProblem,
    LogDeterminant,
    RelaxationProblem,
    RootTrace,
)

ROUNDING = 1e-9  # relative: rounding in 1e6 sums of products stays below 1e-10


@dataclass(frozen=True)
class IndexDual:
    """The pair X, Y (P, P) that proves a bound on ``index`` for sets of ``poses`` candidates (None: any number)."""

    index: str
    poses: int | None
    X: Array
    Y: Array

    @property
    def upper(self) -> bool:
        """Whether the index is maximised."""
        return INDEX_RULES[self.index].maximise

    def verify(self, rows: Array) -> float:
        """Return the bound over all candidates; O2: at least 1, others: at most infinity."""
        X, Y, count = self._semidefinite_pair[0], self._semidefinite_pair[1], self.poses or 1
        x, y = (np.maximum(form, 0.0) for form in self._forms(rows))
        if self.index == "O2":
            return _condition_bound(x, y, float(np.trace(X)), float(np.trace(Y)), count)
        top = sum_largest(x, count) * (1.0 + ROUNDING)
        mu = np.maximum(np.linalg.eigvalsh(X), 0.0)
        if self.index == "O1":
            share = top / count
            return float(np.sqrt(share / (len(mu) * np.exp(np.mean(np.log(mu)))))) if mu[0] > 0 else np.inf
        if self.index == "O3":
            return float(np.sqrt(top / np.sum(mu))) if mu[-1] > 0 else np.inf
        roots = float(np.sum(np.cbrt(mu)))
        return float(np.sqrt(top) / roots**1.5) if roots > 0 else np.inf

    def prices(self, rows: Array, active: Positions) -> Array:
        """Return the reduced cost of every candidate, for O2 with the scale of X that fits the active ones."""
        x, y = self._forms(rows)
        if self.index != "O2":
            return -x
        return np.asarray(y - _smallest_ratio(x[active], y[active], self.poses or 1) * x)

    @cached_property
    def _last_forms(self) -> "dict[str, tuple[ref[Array], Array, Array]]":
        return {}

    @cached_property
    def _semidefinite_pair(self) -> tuple[Array, Array]:
        return project_semidefinite(self.X), project_semidefinite(self.Y)

    def _forms(self, rows: Array) -> tuple[Array, Array]:
        """The forms of all rows with X and Y, (n,) each; kept: the proof and the prices need the same."""
        known = self._last_forms.get("forms")
        if known is None or known[0]() is not rows:
            X, Y = self._semidefinite_pair
            x = quadratic_form(rows, X)
            known = self._last_forms["forms"] = ref(rows), x, quadratic_form(rows, Y) if self.index == "O2" else x
        return known[1], known[2]

    def __getstate__(self) -> dict[str, object]:
        """Leave out what was kept: a copy proves afresh."""
        return {name: value for name, value in vars(self).items() if name in ("index", "poses", "X", "Y")}


@dataclass(frozen=True)
class WholePool:
    """The proof where there is only one set of ``poses`` candidates: its own index."""

    index: str
    poses: int

    @property
    def upper(self) -> bool:
        """Whether the index is maximised."""
        return INDEX_RULES[self.index].maximise

    def verify(self, rows: Array) -> float:
        """Return the index of all candidates, if there are as many."""
        return index_value(self.index, rows) if len(rows) == self.poses else np.nan

    def prices(self, rows: Array, active: Positions) -> Array:
        """Return a price of 0 for each candidate: none is left out for its price."""
        return np.zeros(len(rows))


def _condition_bound(x: Array, y: Array, trace_x: float, trace_y: float, count: int) -> float:
    if not (trace_x > 0 and trace_y > 0):
        return 1.0
    ratio = _smallest_ratio(x, y, count) * (1.0 - ROUNDING)
    holds = float(np.sum(np.partition(y - ratio * x, count - 1)[:count])) >= 0.0
    return max(1.0, float(np.sqrt(ratio * trace_x / trace_y))) if holds else 1.0


def _smallest_ratio(x: Array, y: Array, count: int) -> float:
    """Return the least sum_S y / sum_S x over sets S of ``count``.

    Dinkelbach 1967: the ratio of the present minimiser of y - ratio x is the next ratio; it falls until it repeats.
    """
    ratio = float(np.sum(y) / max(np.sum(x), np.finfo(float).tiny))
    for _ in range(100):
        chosen = np.argpartition(y - ratio * x, count - 1)[:count]
        below = float(np.sum(x[chosen]))
        new = float(np.sum(y[chosen])) / below if below > 0 else np.inf
        if not new < ratio * (1.0 - 1e-13):
            break
        ratio = new
    return ratio


@dataclass(frozen=True)
class IndexPricing(Pricing):
    """The relaxation of an index (not O4) over the candidates ``rows`` (N, r, P)."""

    negligible: ClassVar[float] = 1e-4
    spare: ClassVar[int] = 150  # candidates that come in a round, and that stay beside as many as are chosen

    def first(self, seed: int, near: Certificate | None) -> ActiveSet:
        """Where to begin: around another certificate's support, or with a seeded sample that sees every parameter."""
        rows = self.rows
        poses = self.poses or 0
        count = min(len(rows), max(300, 10 * rows.shape[2], min(2 * poses, poses + self.spare)))
        duals = near.duals if near else ()
        dual = next((d for d in duals if isinstance(d, IndexDual) and d.index == self.name), None)
        if near is None or dual is None or len(dual.X) != rows.shape[2] or len(near.support) == 0:
            return ActiveSet(np.sort(np.random.default_rng(seed).permutation(len(rows))[:count]), np.ones(count))
        price = round_significant(dual.prices(rows, np.arange(len(rows))))
        active = np.union1d(np.lexsort((np.arange(len(rows)), price))[:count], near.support)
        weights = np.full(len(active), 0.1 * np.mean(near.weights))
        weights[np.searchsorted(active, near.support)] += near.weights
        return ActiveSet(active, weights)

    def solve(self, state: ActiveSet, accuracy: float) -> tuple[ActiveSet, Dual, float]:
        """Solve on the active candidates; the index is that of the weights, scaled to sum to the number of poses."""
        problem = self._problem(state)
        z, duals = solve_interior_point(problem, problem.start(state.weights), accuracy, self.limit)
        X, Y = problem.proof(z, duals)
        weights, count = z[: problem.count], self.count
        mass = problem.mass(weights * (count / np.sum(weights)))
        mu = np.sqrt(np.maximum(np.linalg.eigvalsh(mass)[::-1], 0.0))
        dual = IndexDual(self.name, self.poses, read_only(X), read_only(Y))
        return ActiveSet(state.active, weights), dual, float(INDEX_RULES[self.name].of(mu, count))

    def _problem(self, state: ActiveSet) -> RelaxationProblem:
        capped = self.poses is not None and len(state.active) > self.poses  # no row to spare: nothing inside the cap
        active, poses = self.rows[state.active], self.count
        if self.name in ("O2", "O3"):
            return EigenvalueProblem(active, poses, capped, self.name == "O2")
        f = LogDeterminant(active.shape[2]) if self.name == "O1" else RootTrace()
        return ConcaveProblem(active, poses, capped, f)

    def distance(self, relaxed: float, bound: float) -> float:
        """Relative distance to the bound."""
        return abs(relaxed / bound - 1.0)

    def grow(self, state: ActiveSet, dual: Dual) -> ActiveSet:
        """Bring in the candidates that violate the dual most; let go of the idle ones that are furthest from it."""
        price = dual.prices(self.rows, state.active)
        outside = np.ones(len(self.rows), dtype=bool)
        outside[state.active] = False
        count = self.count
        limit = np.partition(price[state.active], count - 1)[count - 1]
        violating = np.flatnonzero(outside & (price < limit))
        order = np.lexsort((violating, round_significant(price[violating])))[: self.spare]
        # the cheapest active ones stay: a step takes the cube of their number
        few = max(self.spare, min(3 * count, count + self.spare))
        stay = np.lexsort((state.active, round_significant(price[state.active])))[:few]
        # 1e-3: of the largest weight: in use
        stay = np.union1d(stay, np.flatnonzero(state.weights > 1e-3 * np.max(state.weights)))
        active = np.concatenate([state.active[stay], violating[order]])
        weights = np.concatenate([state.weights[stay], np.zeros(len(order))])
        arranged = np.argsort(active)
        return ActiveSet(active[arranged], weights[arranged])


@on_one_thread
def certify_bound(
    rows: Array,
    index: str = "O2",
    poses: int | None = None,
    tolerance: float = 5e-4,
    seed: int = 0,
    near: Certificate | None = None,
    limit: TimeLimit = UNLIMITED,
) -> Certificate:
    """Return a certificate that no set of ``poses`` distinct candidates beats ``value`` on ``index``.

    ``rows`` (n, r, P) are reduced to identifiable columns; ``poses`` None bounds sets of any size (O1 and O2 only: the
    others grow without end). ``tolerance`` is the relative gap at which pricing stops; the value is proven
    whatever it is. ``near``: a certificate for another number of poses, whose duals tell where to begin.
    Deterministic.

    Raises:
        InputError: unknown index, more poses than candidates, or an index that needs a number of poses.
    """
    most_rounds = 40  # of adding poses; the gap that is left is told
    find_rule(index)
    if rows.ndim != 3:
        raise InputError(f"candidate rows must have shape (candidates, readings, parameters), not {rows.shape}")
    if poses is None and index not in ("O1", "O2"):
        raise InputError(f"{index} grows with every pose: its bound needs a number of poses")
    if poses is not None and not 1 <= poses <= len(rows):
        raise InputError(f"{poses} poses out of {len(rows)} candidates: choose between 1 and {len(rows)}")
    if index == "O4":
        return _divide_bounds(
            *(certify_bound(rows, part, poses, tolerance, seed, near, limit) for part in ("O3", "O2"))
        )
    if poses == len(rows):
        value, dual = index_value(index, rows), WholePool(index, poses)
        return Certificate(index, value, poses, np.arange(poses), np.ones(poses), value, (dual,), True, 0, poses)
    pricing = IndexPricing(rows, poses, index, limit)
    accuracy = 0.05 if near is None else tolerance
    return generate_columns(pricing, pricing.first(seed, near), tolerance, accuracy, most_rounds)


def _divide_bounds(smallest: Certificate, condition: Certificate) -> Certificate:
    """O4 = O3 / O2."""
    return replace(
        smallest,
        index="O4",
        value=smallest.value / condition.value,
        relaxed=smallest.relaxed / condition.relaxed,
        duals=smallest.duals + condition.duals,
        verified=smallest.verified and condition.verified,
        rounds=smallest.rounds + condition.rounds,
    )


def price_candidates(
    rows: Array, certificate: Certificate, n: int, margin: float = 0.06
) -> tuple[Positions, Positions]:
    """Return all candidates by price, best first, and those whose use could cost less than ``margin`` of the bound.

    By complementary slackness a set within a share e of the bound can hold only candidates whose reduced costs sum up
    to e. One alone that takes up ``margin`` / n more than the n-th cheapest is no bargain.
    """
    everything = np.arange(len(rows))
    dual = certificate.duals[-1]
    if not isinstance(dual, IndexDual):
        return everything, everything
    price = dual.prices(rows, everything)
    order = np.lexsort((everything, round_significant(price)))
    scale = np.mean(quadratic_form(rows[order[:n]], dual.Y if dual.index == "O2" else dual.X))
    near = int(np.sum(price <= price[order[n - 1]] + margin * scale))
    count = min(max(near, 150, 2 * n), 4_000)  # the core: the poses of lowest price, 4000 at most
    return order, np.union1d(order[:count], certificate.support)
