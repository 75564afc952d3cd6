"""Exchange of poses for the discrimination criterion, and the certified bound on it.

The relaxation is solved on a few hundred candidates by the interior-point method of the indices; the bound is proven
afterwards over all candidates from the gradient alone, see :mod:`.criterion`."""

from dataclasses import dataclass, field

import numpy as np

from planner.common.determinism import Positions, round_significant
from planner.common.units import Array
from planner.design.discrimination.criterion import RIDGE, DTCriterion
from planner.design.selection.interior_point import solve_interior_point
from planner.design.selection.relaxation import RelaxationProblem, interior_start, quadratic_form

_SAFE = 1e-9  # rounding in a sum of products
_FIRST, _BATCH = 400, 150  # candidates at first, and those that come in each round
_ROUNDS = 25
TOLERANCE = 2e-3


@dataclass(frozen=True)
class CriterionBound:
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
    support: Positions
    weights: Array
    prices: Array


@dataclass(frozen=True)
class DTRelaxation(RelaxationProblem):
    """The relaxation in the scaled form of :mod:`planner.design.selection.relaxation`: min c - f(M(w)), w <= c."""

    aim: DTCriterion = field(default_factory=lambda: DTCriterion(()))

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
        return np.asarray(1.0 / self.poses - quadratic_form(self.rows, self.aim.slope(mass)))


def prove_bound(value: float, slope: Array, rows: Array, poses: int) -> tuple[float, Array]:
    """Bound that a slope X at a point of value f* proves over all candidates, and their prices (n,)."""
    mu, axes = np.linalg.eigh(slope)
    slope = (axes * np.maximum(mu, 0.0)) @ axes.T
    prices = np.maximum(quadratic_form(rows, slope), 0.0)
    top = float(np.sum(np.partition(prices, len(prices) - poses)[len(prices) - poses :]))
    return value + float(np.log(top + RIDGE * float(np.trace(slope)))) + _SAFE, prices


def bound_criterion(rows: Array, aim: DTCriterion, poses: int, start: Positions) -> CriterionBound:
    """Return a bound on the criterion of any ``poses`` of the candidates ``rows`` (n, r, P).

    ``start``: a choice; the relaxation begins with it and what the whole pool prices best.
    """
    first = aim.slope(np.eye(rows.shape[2]))
    active = np.union1d(_best_prices(quadratic_form(rows, first), max(_FIRST, 3 * poses)), start)
    weights = np.full(len(active), 0.1)
    weights[np.searchsorted(active, start)] += 1.0
    best: CriterionBound | None = None
    for _ in range(_ROUNDS):
        problem = DTRelaxation("O1", rows[active], poses, len(active) > poses, aim)
        z, _ = solve_interior_point(problem, interior_start(problem, weights), TOLERANCE / 3)
        weights = z * (poses / np.sum(z))
        mass = problem.mass(weights)
        relaxed, slope = aim.value(mass), aim.slope(mass)
        value, prices = prove_bound(relaxed, slope, rows, poses)
        if best is None or value < best.value:
            best = CriterionBound(value, poses, slope, relaxed, active, weights, prices)
        limit = np.partition(prices[active], len(active) - poses)[len(active) - poses]
        new = np.setdiff1d(_best_prices(np.where(prices > limit, prices, 0.0), _BATCH), active)
        if best.value - relaxed < TOLERANCE or len(new) == 0 or len(active) >= len(rows):
            break
        stay = active[weights > 1e-4]
        kept = np.union1d(stay, _best_prices(prices, max(_FIRST, 3 * poses)))
        known = dict(zip(active.tolist(), weights.tolist(), strict=True))
        active = np.union1d(kept, new)
        weights = np.array([known.get(int(k), 1e-3) for k in active])
    assert best is not None
    return best


def check_bound(found: CriterionBound, rows: Array) -> bool:
    """Verify a bound again, from its slope alone."""
    return prove_bound(found.at, found.slope, rows, found.poses)[0] <= found.value + 1e-9


def _best_prices(prices: Array, count: int) -> Positions:
    """The candidates with the highest prices, ascending."""
    return np.sort(np.lexsort((np.arange(len(prices)), -round_significant(prices)))[:count])


_NEAR = 96  # candidates that are tried exactly, those with the best prices
_SWAPS = 500
_BETTER = 1e-7  # gain below which a swap is none
_STARTS = 3


def sum_information(rows: Array) -> Array:
    """Sum of J'J over rows (n, r, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    return np.asarray(tall.T @ tall)


def exchange_by_criterion(
    rows: Array, aim: DTCriterion, found: CriterionBound, start: Positions, seed: int, group: Positions
) -> Positions:
    """Return the best set of as many candidates as ``start`` has, ascending.

    Starts from ``start``, from the relaxation's heaviest candidates, and from some drawn by their weights. Of the
    candidates of one ``group`` (N,) only one is taken.
    """
    best, value = start, -np.inf
    for turn in range(_STARTS + 1):
        chosen = start if turn == _STARTS else _draw_by_weight(found, len(start), seed, turn, group)
        if len(chosen) < len(start):
            continue
        chosen = descend_criterion(rows, aim, chosen, group)
        new = aim.value(sum_information(rows[chosen]))
        if new > value + _BETTER:
            best, value = chosen, new
    return np.sort(best)


def descend_criterion(rows: Array, aim: DTCriterion, chosen: Positions, group: Positions) -> Positions:
    """Take the best swap until there is none; of the candidates of one group (N,) only one is taken."""
    for _ in range(_SWAPS):
        mass = sum_information(rows[chosen])
        prices = round_significant(quadratic_form(rows, aim.slope(mass)))
        prices[chosen] = -np.inf
        twins = np.setdiff1d(np.flatnonzero(np.isin(group, group[chosen])), chosen)
        outside = np.lexsort((np.arange(len(rows)), -prices))[: min(_NEAR, len(rows) - len(chosen))]
        near = np.union1d(outside, twins)
        if len(near) == 0:
            break
        gains = swap_gains(rows[chosen], rows[near], aim, mass)
        gains[np.isin(group[near], group[chosen]) & (group[chosen][:, None] != group[near])] = -np.inf
        out, into = np.unravel_index(int(np.argmax(round_significant(gains))), gains.shape)
        if gains[out, into] < _BETTER:
            break
        chosen = np.where(np.arange(len(chosen)) == out, near[into], chosen)
    return chosen


def swap_gains(inner: Array, outer: Array, aim: DTCriterion, mass: Array) -> Array:
    """Exact change of the criterion, (n, m), when each of ``outer`` (m, r, P) takes the place of one of ``inner``.

    A swap multiplies a determinant by det(I + C), C of 2 r rows made of products of the swapped rows (Sylvester).
    """
    n, m, r = len(inner), len(outer), inner.shape[1]
    both = np.concatenate([inner, outer]).reshape((n + m) * r, -1)
    total = np.zeros((n, m))
    for weight, root in aim.roots(mass):
        seen = (both @ root).reshape(n + m, r, -1)
        flat = seen.reshape(-1, seen.shape[2])
        cross = (flat[: n * r] @ flat[n * r :].T).reshape(n, r, m, r).transpose(0, 2, 1, 3)
        own = np.einsum("nra,nsa->nrs", seen, seen)
        if r == 1:
            ratio = (1.0 - own[:n, 0]) * (1.0 + own[None, n:, 0, 0]) + cross[:, :, 0, 0] ** 2
            total += weight * np.log(np.maximum(ratio, 1e-300))
            continue
        block = np.empty((n, m, 2 * r, 2 * r))
        block[:, :, :r, :r] = np.eye(r) - own[:n, None]
        block[:, :, :r, r:] = -cross
        block[:, :, r:, :r] = cross.swapaxes(2, 3)
        block[:, :, r:, r:] = np.eye(r) + own[None, n:]
        total += weight * np.log(np.maximum(np.linalg.det(block), 1e-300))
    return total


def _draw_by_weight(found: CriterionBound, count: int, seed: int, turn: int, group: Positions) -> Positions:
    """Take ``count`` of the relaxation's candidates, one a group: the heaviest first, later drawn by weight."""
    weights = np.maximum(found.weights, 1e-12)
    if turn == 0:
        keys = round_significant(weights)
    else:  # Efraimidis and Spirakis 2006: weighted sampling without replacement
        keys = np.log(np.random.default_rng([seed, turn]).random(len(weights))) / weights
    order = found.support[np.lexsort((found.support, -keys))]
    first = np.sort(np.unique(group[order], return_index=True)[1])
    return np.sort(order[first[:count]])
