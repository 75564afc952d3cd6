"""The certified bound: no set of as many candidates has a better criterion.

The relaxation (weights between nothing and once, as many as poses) is solved on a few hundred candidates by the same
interior-point method as the indices', those that its slope prices best come in, and so on. What counts is proven
afterwards, over all candidates and from the slope alone: see :mod:`.criterion`.
"""

from dataclasses import dataclass, field

import numpy as np

from planner.repeatable import Places, canonical
from planner.selection.interior import solve
from planner.selection.relaxation import Problem, inside, quadratic
from planner.separating.criterion import RIDGE, Criterion
from planner.units import Array

_SAFE = 1e-9  # rounding in a sum of products
_FIRST, _BATCH = 400, 150  # candidates at first, and those that come in each round
_ROUNDS = 25
TOLERANCE = 2e-3


@dataclass(frozen=True)
class Bound:
    """A bound on the criterion's value.

    Attributes:
        value: no set of ``poses`` candidates has more.
        slope: X (P, P) that proves it, and ``at`` the criterion where it was taken.
        support, weights: candidates of the relaxation, (k,), and their weights (sum = poses).
        prices: <X, J'J> of every candidate, (n,).
    """

    value: float
    poses: int
    slope: Array
    at: float
    support: Places
    weights: Array
    prices: Array


@dataclass(frozen=True)
class Relaxed(Problem):
    """The relaxation in the scaled form of :mod:`planner.selection.relaxation`: min c - f(M(w)), w <= c."""

    aim: Criterion = field(default_factory=lambda: Criterion(()))

    def objective(self, z: Array) -> float:
        """The value that is minimised."""
        return float(np.sum(z)) / self.poses - self.aim.value(self.mass(z))

    def slope(self, z: Array, hessian: Array) -> Array:
        """Gradient of the objective; its second derivative is added to ``hessian``."""
        mass = self.mass(z)
        for weight, root in self.aim.roots(mass):
            seen = self.rows.reshape(-1, self.rows.shape[2]) @ root
            products = (seen @ seen.T) ** 2
            n, r = self.rows.shape[:2]
            hessian += weight * (products if r == 1 else products.reshape(n, r, n, r).sum(axis=(1, 3)))
        return np.asarray(1.0 / self.poses - quadratic(self.rows, self.aim.slope(mass)))


def proven(value: float, slope: Array, rows: Array, poses: int) -> tuple[float, Array]:
    """Bound that a slope X at a point of value f* proves over all candidates, and their prices (n,)."""
    mu, axes = np.linalg.eigh(slope)
    slope = (axes * np.maximum(mu, 0.0)) @ axes.T
    prices = np.maximum(quadratic(rows, slope), 0.0)
    top = float(np.sum(np.partition(prices, len(prices) - poses)[len(prices) - poses :]))
    return value + float(np.log(top + RIDGE * float(np.trace(slope)))) + _SAFE, prices


def bound(rows: Array, aim: Criterion, poses: int, start: Places) -> Bound:
    """Return a bound on the criterion of any ``poses`` of the candidates ``rows`` (n, r, P).

    ``start``: a choice; the relaxation begins with it and what the whole pool prices best.
    """
    first = aim.slope(np.eye(rows.shape[2]))
    active = np.union1d(_best(quadratic(rows, first), max(_FIRST, 3 * poses)), start)
    weights = np.full(len(active), 0.1)
    weights[np.searchsorted(active, start)] += 1.0
    best: Bound | None = None
    for _ in range(_ROUNDS):
        problem = Relaxed("O1", rows[active], poses, len(active) > poses, aim)
        z, _ = solve(problem, inside(problem, weights), TOLERANCE / 3)
        weights = z * (poses / np.sum(z))
        mass = problem.mass(weights)
        relaxed, slope = aim.value(mass), aim.slope(mass)
        value, prices = proven(relaxed, slope, rows, poses)
        if best is None or value < best.value:
            best = Bound(value, poses, slope, relaxed, active, weights, prices)
        limit = np.partition(prices[active], len(active) - poses)[len(active) - poses]
        new = np.setdiff1d(_best(np.where(prices > limit, prices, 0.0), _BATCH), active)
        if best.value - relaxed < TOLERANCE or len(new) == 0 or len(active) >= len(rows):
            break
        stay = active[weights > 1e-4]
        kept = np.union1d(stay, _best(prices, max(_FIRST, 3 * poses)))
        known = dict(zip(active.tolist(), weights.tolist(), strict=True))
        active = np.union1d(kept, new)
        weights = np.array([known.get(int(k), 1e-3) for k in active])
    assert best is not None
    return best


def check(found: Bound, rows: Array) -> bool:
    """Verify a bound again, from its slope alone."""
    return proven(found.at, found.slope, rows, found.poses)[0] <= found.value + 1e-9


def _best(prices: Array, count: int) -> Places:
    """The candidates with the highest prices, ascending."""
    return np.sort(np.lexsort((np.arange(len(prices)), -canonical(prices)))[:count])
