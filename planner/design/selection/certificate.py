"""A proof that no set of the candidates does better than ``value``: a dual pair, checked afresh over all of them.

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

from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions
from planner.common.units import Array, read_only
from planner.design.selection.relaxation import quadratic_form

_SAFE = 1e-9  # relative: rounding in 1e6 sums of products stays below 1e-10


@dataclass(frozen=True)
class Dual:
    """The pair X, Y (P, P) that proves a bound on ``index`` for sets of ``poses`` candidates (None: any number)."""

    index: str
    poses: int | None
    X: Array
    Y: Array


@dataclass(frozen=True)
class Certificate:
    """A bound on an index over all sets of candidates.

    ``value``: no set does better (O2: not below, others: not above). ``kind``: "exactly n poses" or "any number of
    poses". ``poses`` n or None; ``support`` the candidates with weight in the relaxation and ``weights`` theirs (sum n,
    or 1 for any number); ``relaxed`` the relaxation's own optimum as far as solved, so that ``slack`` = how far, at
    most, the bound is below the best that this relaxation can prove; ``duals`` what :func:`verify_dual` checks;
    ``verified``
    the outcome of that check over all ``candidates``; ``rounds`` of pricing.
    """

    index: str
    kind: str
    value: float
    poses: int | None
    support: Positions
    weights: Array
    relaxed: float
    duals: tuple[Dual, ...]
    verified: bool
    rounds: int
    candidates: int

    @property
    def slack(self) -> float:
        """Relative distance between the relaxation's optimum and the proven value."""
        return abs(self.relaxed / self.value - 1.0)


def verify_dual(dual: Dual, rows: Array) -> float:
    """Return the bound that a dual pair proves over all candidates ``rows`` (n, r, P); the trivial one if none.

    O2: at least 1. Others: at most infinity. Matrices that are not positive semidefinite are first made so.
    """
    X, Y = _project_semidefinite(dual.X), _project_semidefinite(dual.Y)
    x = np.maximum(quadratic_form(rows, X), 0.0)
    if dual.index == "O2":
        y = np.maximum(quadratic_form(rows, Y), 0.0)
        return _condition_bound(x, y, float(np.trace(X)), float(np.trace(Y)), dual.poses)
    top = _sum_largest(x, dual.poses) * (1.0 + _SAFE)
    mu = np.maximum(np.linalg.eigvalsh(X), 0.0)
    if dual.index == "O1":
        share = top / (dual.poses or 1)
        return float(np.sqrt(share / (len(mu) * np.exp(np.mean(np.log(mu)))))) if mu[0] > 0 else np.inf
    if dual.index == "O3":
        return float(np.sqrt(top / np.sum(mu))) if mu[-1] > 0 else np.inf
    roots = float(np.sum(np.cbrt(mu)))
    return float(np.sqrt(top) / roots**1.5) if roots > 0 else np.inf


def _project_semidefinite(matrix: Array) -> Array:
    """The nearest positive semidefinite matrix; one with a number that is not finite becomes zero."""
    if not np.all(np.isfinite(matrix)):
        return np.zeros_like(matrix)
    mu, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((axes * np.maximum(mu, 0.0)) @ axes.T)


def _sum_largest(values: Array, poses: int | None) -> float:
    """Sum of the n largest, or the largest alone."""
    count = poses or 1
    return float(np.sum(np.partition(values, len(values) - count)[len(values) - count :]))


def _condition_bound(x: Array, y: Array, trace_x: float, trace_y: float, poses: int | None) -> float:
    if not (trace_x > 0 and trace_y > 0):
        return 1.0
    ratio = smallest_ratio(x, y, poses or 1)[0] * (1.0 - _SAFE)
    holds = float(np.sum(_take_smallest(y - ratio * x, poses or 1))) >= 0.0
    return max(1.0, float(np.sqrt(ratio * trace_x / trace_y))) if holds else 1.0


def _take_smallest(values: Array, count: int) -> Array:
    return np.asarray(np.partition(values, count - 1)[:count])


def smallest_ratio(x: Array, y: Array, count: int) -> tuple[float, float]:
    """Return the least sum_S y / sum_S x over sets S of ``count``, and the threshold on y - ratio x that S obeys.

    Dinkelbach 1967: the ratio of the present minimiser of y - ratio x is the next ratio; it falls until it repeats.
    """
    ratio = float(np.sum(y) / max(np.sum(x), np.finfo(float).tiny))
    threshold = 0.0
    for _ in range(100):
        value = y - ratio * x
        chosen = np.argpartition(value, count - 1)[:count]
        threshold = float(np.max(value[chosen]))
        below = float(np.sum(x[chosen]))
        new = float(np.sum(y[chosen])) / below if below > 0 else np.inf
        if not new < ratio * (1.0 - 1e-13):
            break
        ratio = new
    return ratio, threshold


def frozen_dual(index: str, poses: int | None, X: Array, Y: Array) -> Dual:
    """Return a dual with read-only matrices."""
    return Dual(index, poses, read_only(X), read_only(Y))
