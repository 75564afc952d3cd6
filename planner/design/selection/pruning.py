"""The EDBB paper's backward pruning: poses go one at a time, each time the one whose loss hurts the index least.

Made fast by laziness. Taking pose i away cannot leave the smallest eigenvalue above the smallest of M - J_i'J_i within
the plane of the two lowest eigenvectors of M, nor the largest below its like at the top (Cauchy interlacing). So a few
numbers a candidate bound its cost from below, and exact eigenvalues are computed in the order of these bounds only
until no bound is left that could win. The result is the one that an SVD per candidate and step would give.
"""

from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.errors import InputError
from planner.common.units import Array
from planner.design.observability.information import find_rule, index_value
from planner.design.selection.index_search import find_knee
from planner.design.selection.matrix_forms import information_matrix, quadratic_form

EXACT_FROM = 3_400
"""As many as the EDBB paper prunes one at a time. Larger pools are first thinned: a twelfth goes at a time, those with
the least bounds, all judged at once."""


@on_one_thread
def prune_poses(rows: Array, n: int, index: str = "O2", exact_from: int = EXACT_FROM) -> Positions:
    """Return the ``n`` candidates (n,) that backward pruning leaves of ``rows`` (N, r, P), ascending.

    Raises:
        InputError: unknown index, or n outside what the candidates and parameters allow.
    """
    return np.sort(order_by_pruning(rows, n, index, exact_from)[:n])


def order_by_pruning(rows: Array, n: int, index: str = "O2", exact_from: int = EXACT_FROM) -> Positions:
    """Return candidates (K,) of ``rows`` (N, r, P) so that the first k are those left with k poses, for k from n to K.

    From K, the larger of n and ``exact_from``, on it is step for step the naive pruning; ties go to the lower index.
    Source: the pruning of the EDBB paper (section 2.1), after Borm and Menq 1991.

    Raises:
        InputError: unknown index, or n outside what the candidates and parameters allow.
    """
    find_rule(index)
    least = -(-rows.shape[2] // rows.shape[1])
    if not least <= n <= len(rows):
        raise InputError(f"{n} poses cannot be kept: ask for {least} (the parameters) to {len(rows)} (the pool)")
    kept = np.arange(len(rows))
    while len(kept) > max(n, exact_from):
        count = min(-(-len(kept) // 12), len(kept) - max(n, exact_from))  # a twelfth goes at a time
        costs = round_significant(_bound_cost(rows[kept], information_matrix(rows[kept]), index))
        kept = np.sort(kept[np.lexsort((kept, costs))[count:]])
    mass = information_matrix(rows[kept])
    gone: list[int] = []
    for step in range(len(kept) - n):
        if step % 64 == 0:  # moves after which rounding is taken out
            mass = information_matrix(rows[kept])
        out = _find_least_valuable_pose(rows[kept], mass, index)
        mass = mass - information_matrix(rows[kept[out : out + 1]])
        gone.append(int(kept[out]))
        kept = np.delete(kept, out)
    return np.concatenate([kept, np.array(gone[::-1], dtype=kept.dtype)])


@dataclass(frozen=True)
class PrunedPoses:
    """What backward pruning leaves of the candidates for each number of poses (EDBB paper, Fig. 5).

    Attributes:
        index: name of the index.
        order: candidates (K,); the first n are those left with n poses.
        sizes: numbers of poses, ascending from as few as the parameters take, (k,).
        values: the index of each, (k,).
    """

    index: str
    order: Positions
    sizes: Positions
    values: Array

    @classmethod
    @on_one_thread
    def of(cls, rows: Array, index: str, most: int) -> "PrunedPoses":
        """Prune the candidates ``rows`` (N, r, P) until n = m; the index is told for up to ``most`` poses.

        Raises:
            InputError: unknown index, or fewer candidates than parameters.
        """
        least = -(-rows.shape[2] // rows.shape[1])
        order = order_by_pruning(rows, least, index, max(EXACT_FROM, most))
        sizes = np.arange(least, min(most, len(order)) + 1)
        return cls(index, order, sizes, np.array([index_value(index, rows[order[:n]]) for n in sizes]))

    @property
    def knee(self) -> int:
        """The number of poses where the curve bends (see :func:`find_knee`)."""
        return find_knee(self.sizes, self.values, self.index)

    def choose(self, n: int) -> Positions:
        """Return the candidates that are left with ``n`` poses, ascending, (n,)."""
        return np.sort(self.order[:n])


def _find_least_valuable_pose(rows: Array, mass: Array, index: str) -> int:
    """Position of the pose whose removal costs least, exactly."""
    size = 12  # candidates whose cost is computed at a time
    floor = _bound_cost(rows, mass, index)
    if index == "O1" and rows.shape[1] == 1:
        return int(np.argmin(round_significant(floor)))  # the bound is the cost itself
    order = np.argsort(floor, kind="stable")
    best, at = np.inf, len(rows)
    for k in range(0, len(order), size):
        batch = order[k : k + size]
        if floor[batch[0]] > best + 1e-9 * abs(best):
            break
        left = mass - np.swapaxes(rows[batch], 1, 2) @ rows[batch]
        costs = round_significant(index_cost(np.asarray(np.linalg.eigvalsh(left)), index))
        low = float(np.min(costs))
        first = int(np.min(batch[costs == low]))
        if low < best or (low == best and first < at):
            best, at = low, first
    return at if at < len(rows) else int(order[0])


def index_cost(mu: Array, index: str) -> Array:
    """What grows as the index gets worse, for ascending eigenvalues (..., P); inf when a direction is unseen."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = mu[..., 0], mu[..., -1]
        if index == "O1":
            value = -np.sum(np.log(np.maximum(mu, 0.0)), axis=-1)
        elif index == "O2":
            value = high / low
        elif index == "O3":
            value = -low
        elif index == "O4":
            value = -(low**2) / high
        else:
            value = np.sum(np.maximum(mu, 0.0) ** -0.5, axis=-1)
    return np.asarray(np.where(low > 1e-13 * high, value, np.inf))


def _bound_cost(rows: Array, mass: Array, index: str) -> Array:
    """A lower bound on the cost after taking each pose away, (n,)."""
    mu, axes = np.linalg.eigh(mass)
    if index == "O1":  # exact for one reading a pose; log det is concave, so its slope bounds it in general
        share = quadratic_form(rows, (axes / mu) @ axes.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            loss = -np.log(np.maximum(1.0 - share, 0.0)) if rows.shape[1] == 1 else share
        return np.asarray(loss - np.sum(np.log(mu)))
    if index == "O5":  # convex: above its tangent
        return np.asarray(np.sum(mu**-0.5) + 0.5 * quadratic_form(rows, (axes * mu**-1.5) @ axes.T))
    low = np.maximum(_plane_eigenvalue(rows, mu[:2], axes[:, :2], -1.0), 0.0)
    high = np.maximum(_plane_eigenvalue(rows, mu[:-3:-1], axes[:, :-3:-1], 1.0), mu[-2])
    with np.errstate(divide="ignore"):
        return np.asarray({"O2": high / low, "O3": -low, "O4": -(low**2) / high}[index])


def _plane_eigenvalue(rows: Array, mu: Array, axes: Array, side: float) -> Array:
    """Least (side -1) or largest (1) eigenvalue, after taking each pose away, within the plane of two eigenvectors."""
    seen = rows @ axes
    a = mu[0] - np.sum(seen[:, :, 0] ** 2, axis=1)
    b = mu[1] - np.sum(seen[:, :, 1] ** 2, axis=1)
    c = np.sum(seen[:, :, 0] * seen[:, :, 1], axis=1)
    return np.asarray((a + b) / 2 + side * np.hypot((a - b) / 2, c))
