"""Scores of all swaps (one pose out, one candidate in) at once."""

from dataclasses import dataclass

import numpy as np

from planner.observability import rule
from planner.repeatable import Places, canonical
from planner.units import Array

from .potential import Potential
from .relaxation import quadratic

_BLOCK = 2_000_000  # pairs scored at a time
_EXACT = 48  # pairs whose eigenvalues are computed


@dataclass(frozen=True)
class Swap:
    """Position ``out`` in the chosen set and candidate ``into`` that takes its place."""

    out: int
    into: int


def information(rows: Array) -> Array:
    """Sum of J_i'J_i, (P, P), over rows (n, r, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    return np.asarray(tall.T @ tall)


def eigenvalues(mass: Array) -> Array:
    """Eigenvalues (..., P), ascending, of symmetric matrices (..., P, P)."""
    return np.asarray(np.linalg.eigvalsh(mass), dtype=float)


def index_of(kind: str, mass: Array, poses: int) -> Array:
    """Return the index of information matrices (..., P, P)."""
    mu = np.sqrt(np.maximum(eigenvalues(mass)[..., ::-1], 0.0))
    return rule(kind).of(mu, poses)


def scored(
    rows: Array, chosen: Places, pool: Places, potential: Potential, keep: int, group: Places | None = None
) -> tuple[list[Swap], Array]:
    """Return the ``keep`` most promising swaps and their scores, best first.

    Scores are the exact change of the barrier (as a log) with one reading a pose, its first order otherwise. Swaps
    between different groups of ``group`` (N,) come last.
    """
    if len(pool) == 0:
        return [], np.zeros(0)
    score = Table(rows[chosen], potential)
    width = max(1, _BLOCK // len(chosen))
    scores, places = [], []
    for k in range(0, len(pool), width):
        table = score.of(rows[pool[k : k + width]])
        if group is not None:
            table[group[chosen][:, None] != group[pool[k : k + width]][None]] = -np.inf
        best = np.argpartition(-table, min(keep, table.size - 1), axis=None)[:keep]
        scores.append(table.ravel()[best])
        out, into = np.unravel_index(best, table.shape)
        places.append(np.stack([out, into + k], axis=1))
    found, place = np.concatenate(scores), np.concatenate(places)
    order = np.lexsort((place[:, 0], place[:, 1], -canonical(found)))[:keep]
    return [Swap(int(i), int(pool[j])) for i, j in place[order]], found[order]


class Table:
    """Scores of swaps out of one chosen set ``inner`` (n, r, P)."""

    def __init__(self, inner: Array, potential: Potential) -> None:
        self.inner, self.exact = inner, exact(inner, potential)
        self.weights = potential.weights(inner.shape[2])
        self.mu, axes = np.linalg.eigh(information(inner))
        self.below, self.above = potential.inverses(self.mu, axes, *potential.shifts(self.mu))

    def of(self, outer: Array, members: slice = slice(None)) -> Array:
        """Scores (n, N) of taking each of ``outer`` (N, r, P) for each of the chosen, or of a slice of them."""
        m, k = self.weights
        inner = self.inner[members]
        if self.exact:
            table = m * _log_ratio(inner[:, 0], outer[:, 0], self.below, 1.0)
            return table if k == 0 else table + k * _log_ratio(inner[:, 0], outer[:, 0], self.above, -1.0)
        slope = m * self.below - k * self.above
        return np.asarray(quadratic(outer, slope)[None, :] - quadratic(inner, slope)[:, None])


def exact(rows: Array, potential: Potential) -> bool:
    """Tell whether the table is the exact change: one reading a pose, and an index made of determinants."""
    return rows.shape[1] == 1 and potential.index != "O5"


def _log_ratio(inner: Array, outer: Array, inverse: Array, sign: float) -> Array:
    """Log of det(A + sign (v v' - u u')) / det(A) for u in ``inner``, v in ``outer``; very low outside the cone.

    A rank-two change: (1 + s v'A^-1 v)(1 - s u'A^-1 u) + (u'A^-1 v)^2. Adding first shows that only one eigenvalue can
    turn negative, so the sign of the ratio tells whether the matrix stays positive definite.
    """
    half = inner @ inverse
    ratio = (half @ outer.T) ** 2
    own = 1.0 - sign * np.sum(half * inner, axis=1)
    ratio += np.outer(own, 1.0 + sign * np.einsum("ij,ij->i", outer @ inverse, outer))
    return np.asarray(np.log(np.maximum(ratio, 1e-300, out=ratio), out=ratio))


def after(rows: Array, chosen: Places, swaps: list[Swap]) -> Array:
    """Information matrices (k, P, P) after each of ``swaps``."""
    out = rows[chosen[[s.out for s in swaps]]]
    into = rows[[s.into for s in swaps]]
    change = np.swapaxes(into, 1, 2) @ into - np.swapaxes(out, 1, 2) @ out
    return np.asarray(information(rows[chosen]) + change)


def best_by_potential(
    rows: Array, chosen: Places, pool: Places, potential: Potential, group: Places | None = None
) -> Swap | None:
    """The swap that betters the potential most, of those within a group if there are groups, or None."""
    sure = exact(rows, potential)
    if sure and potential.index == "O1":
        pool = _hopeful(rows, chosen, pool)
    swaps, scores = scored(rows, chosen, pool, potential, 1 if sure else _EXACT, group)
    if group is not None:
        kept = [k for k, s in enumerate(swaps) if group[chosen[s.out]] == group[s.into]]
        swaps, scores = [swaps[k] for k in kept], scores[kept]
    if sure:
        return swaps[0] if swaps and scores[0] > 1e-10 else None
    if not swaps:
        return None
    mu = eigenvalues(information(rows[chosen]))
    shifts = potential.shifts(mu)
    gains = canonical(potential.barrier(eigenvalues(after(rows, chosen, swaps)), *shifts))
    best = int(np.argmax(gains))
    return swaps[best] if gains[best] > potential.barrier(mu, *shifts) + 1e-10 else None


def _hopeful(rows: Array, chosen: Places, pool: Places) -> Places:
    """Candidates that can gain determinant at all: by Cauchy-Schwarz a swap multiplies it by at most 1 + d_j - d_i."""
    inverse = np.asarray(np.linalg.inv(information(rows[chosen])), dtype=float)
    return pool[quadratic(rows[pool], inverse) > np.min(quadratic(rows[chosen], inverse))]


def best_by_index(rows: Array, chosen: Places, pool: Places, potential: Potential) -> Swap | None:
    """The swap that betters the index itself most, among those the potential finds most promising, or None."""
    swaps, _ = scored(rows, chosen, pool, potential, _EXACT)
    if not swaps:
        return None
    index = rule(potential.index)
    now = float(index_of(potential.index, information(rows[chosen]), len(chosen)))
    values = canonical(index_of(potential.index, after(rows, chosen, swaps), len(chosen)))
    best = int(np.argmax(values) if index.maximise else np.argmin(values))
    better = index.gap(now, float(values[best])) > 1e-10 if index.maximise else now / values[best] - 1 > 1e-10
    return swaps[best] if better else None
