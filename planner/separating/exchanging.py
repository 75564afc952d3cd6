"""Exchange of poses for the criterion: the swap that betters it most, until there is none."""

import numpy as np

from planner.repeatable import Places, canonical
from planner.selection.relaxation import quadratic
from planner.separating.bounding import Bound
from planner.separating.criterion import Criterion
from planner.units import Array

_NEAR = 96  # candidates that are tried exactly, those with the best prices
_SWAPS = 500
_BETTER = 1e-7  # gain below which a swap is none
_STARTS = 3


def information(rows: Array) -> Array:
    """Sum of J'J over rows (n, r, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    return np.asarray(tall.T @ tall)


def exchange(rows: Array, aim: Criterion, found: Bound, start: Places, seed: int, group: Places) -> Places:
    """Return the best set of as many candidates as ``start`` has, ascending.

    Starts from ``start``, from the relaxation's heaviest candidates, and from some drawn by their weights. Of the
    candidates of one ``group`` (N,) only one is taken.
    """
    best, value = start, -np.inf
    for turn in range(_STARTS + 1):
        chosen = start if turn == _STARTS else _drawn(found, len(start), seed, turn, group)
        if len(chosen) < len(start):
            continue
        chosen = descend(rows, aim, chosen, group)
        new = aim.value(information(rows[chosen]))
        if new > value + _BETTER:
            best, value = chosen, new
    return np.sort(best)


def descend(rows: Array, aim: Criterion, chosen: Places, group: Places) -> Places:
    """Take the best swap until there is none; of the candidates of one group (N,) only one is taken."""
    for _ in range(_SWAPS):
        mass = information(rows[chosen])
        prices = canonical(quadratic(rows, aim.slope(mass)))
        prices[chosen] = -np.inf
        twins = np.setdiff1d(np.flatnonzero(np.isin(group, group[chosen])), chosen)
        outside = np.lexsort((np.arange(len(rows)), -prices))[: min(_NEAR, len(rows) - len(chosen))]
        near = np.union1d(outside, twins)
        if len(near) == 0:
            break
        gains = changes(rows[chosen], rows[near], aim, mass)
        gains[np.isin(group[near], group[chosen]) & (group[chosen][:, None] != group[near])] = -np.inf
        out, into = np.unravel_index(int(np.argmax(canonical(gains))), gains.shape)
        if gains[out, into] < _BETTER:
            break
        chosen = np.where(np.arange(len(chosen)) == out, near[into], chosen)
    return chosen


def changes(inner: Array, outer: Array, aim: Criterion, mass: Array) -> Array:
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


def _drawn(found: Bound, count: int, seed: int, turn: int, group: Places) -> Places:
    """Take ``count`` of the relaxation's candidates, one a group: the heaviest first, later drawn by weight."""
    weights = np.maximum(found.weights, 1e-12)
    if turn == 0:
        keys = canonical(weights)
    else:  # Efraimidis and Spirakis 2006: weighted sampling without replacement
        keys = np.log(np.random.default_rng([seed, turn]).random(len(weights))) / weights
    order = found.support[np.lexsort((found.support, -keys))]
    first = np.sort(np.unique(group[order], return_index=True)[1])
    return np.sort(order[first[:count]])
