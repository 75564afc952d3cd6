"""The observability indices as criteria of an exchange: by a smooth stand-in for the index, and by the index itself.

The stand-in has barriers below the smallest and above the largest eigenvalue, and its changes by swaps are exact.

With information matrix M and eigenvalues lambda, the logarithm of kappa^2 is the least log(u / l) with
l I <= M <= u I. The potential adds barriers to it,

    f(M) = min over l, u of  log u - b log l - m log det(M / l - I) - k log det(I - M / u)

and tends to the index as m and k fall to zero (b = 1 for O2, 2 for O4; O3 has the lower half alone; O1 is l = 0). Two
things make it the right tool for exchanges: at fixed l and u a swap changes it by a ratio of small determinants, known
exactly for all pairs at the price of one matrix product. And the minimum over l and u makes that change an upper bound,
so every swap that looks better is better. Barriers of this kind: Batson, Spielman and Srivastava 2012.
"""

from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions, round_significant
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.matrix_forms import information_matrix, quadratic_form, swap_log_ratios, trial_log_ratios
from planner.design.selection.search import Swap

_LOWER = {"O2": 1.0, "O3": 1.0, "O4": 2.0}  # power of the smallest singular value in the index
_UPPER = ("O2", "O4")  # in which the largest stands
TRIED_PAIRS = 48  # of the best scores, whose eigenvalues are computed
LEAST_GAIN = 1e-10  # of the criterion [1]: below, a swap is rounding
# weights of the barriers, one after the other: the weakest follows the index closest
BARRIER_STRENGTHS = (0.1, 0.02, 0.003)


@dataclass(frozen=True)
class BarrierPotential:
    """The stand-in for ``index``; ``strength`` (0 to 1) is how much the barriers weigh."""

    index: str
    strength: float

    def weights(self, size: int) -> tuple[float, float]:
        """Return the barrier weights (m, k) for ``size`` parameters."""
        if self.index not in _LOWER:
            return 1.0, 0.0
        upper = 0.15  # few eigenvalues crowd at the top, many at the bottom: the upper barrier wants another weight
        return self.strength / size, upper * self.strength if self.index in _UPPER else 0.0

    def shifts(self, mu: Array) -> tuple[float, float]:
        """Return the best l and u for eigenvalues ``mu`` (P,), ascending; l 0 and u inf where a half is missing."""
        m, k = self.weights(len(mu))
        lower, upper = 0.0, np.inf
        if self.index in _LOWER:
            lower = _solve_shift(1.0 / mu, m, _LOWER[self.index])
        if k > 0:
            upper = 1.0 / _solve_shift(mu, k, 1.0 + k * len(mu))
        return lower, upper

    def barrier(self, mu: Array, lower: float, upper: float) -> Array:
        """The barriers at fixed l and u, (...) for eigenvalues (..., P): higher is better, -inf outside."""
        with np.errstate(divide="ignore"):
            if self.index == "O5":
                return np.asarray(-np.log(np.sum(np.maximum(mu, 0.0) ** -0.5, axis=-1)))
            m, k = self.weights(mu.shape[-1])
            total = m * np.sum(np.log(np.maximum(mu - lower, 0.0)), axis=-1)
            if k > 0:
                total = total + k * np.sum(np.log(np.maximum(upper - mu, 0.0)), axis=-1)
        return np.asarray(total)

    def inverses(self, mu: Array, axes: Array, lower: float, upper: float) -> tuple[Array, Array]:
        """Return (M - l I)^-1 and (u I - M)^-1, (P, P): slopes of the barriers; zero where there is no upper half."""
        below = (axes * (mu - lower) ** (-1.5 if self.index == "O5" else -1.0)) @ axes.T
        return below, (axes / (upper - mu)) @ axes.T if np.isfinite(upper) else np.zeros_like(below)


def _solve_shift(poles: Array, weight: float, total: float) -> float:
    """Solve weight sum 1 / (1 - t p) = total for t below the least 1 / p: t is l for p = 1 / mu, and 1 / u for p = mu.

    Newton on the reciprocal of the sum, which is concave and falls: from above it comes down monotonely, in few steps.
    """
    at = (1.0 - weight / total) / float(poles.max())
    for _ in range(25):  # Newton steps at most
        inverse = 1.0 / (1.0 - at * poles)
        share = weight * float(inverse.sum()) / total
        if share <= 1.0 + 1e-9:
            break
        at -= share * (share - 1.0) * total / (weight * float(poles @ inverse**2))
    return at


def eigenvalues(mass: Array) -> Array:
    """Eigenvalues (..., P), ascending, of symmetric matrices (..., P, P)."""
    return np.asarray(np.linalg.eigvalsh(mass), dtype=float)


def index_of_information(kind: str, mass: Array, poses: int) -> Array:
    """Return the index of information matrices (..., P, P)."""
    mu = np.sqrt(np.maximum(eigenvalues(mass)[..., ::-1], 0.0))
    return find_rule(kind).of(mu, poses)


def index_of_rows(kind: str, rows: Array) -> float:
    """Return the index of the poses with ``rows`` (n, r, P)."""
    return float(index_of_information(kind, information_matrix(rows), len(rows)))


def is_exact(rows: Array, index: str) -> bool:
    """Tell whether a swap's score is the exact change: one reading a pose, and an index made of determinants."""
    return rows.shape[1] == 1 and index != "O5"


class SwapTable:
    """Scores of swaps out of one chosen set ``inner`` (n, r, P)."""

    def __init__(self, inner: Array, potential: BarrierPotential) -> None:
        self.inner, self.exact = inner.copy(), is_exact(inner, potential.index)
        self.weights = potential.weights(inner.shape[2])
        self.mu, axes = np.linalg.eigh(information_matrix(inner))
        self.below, self.above = potential.inverses(self.mu, axes, *potential.shifts(self.mu))

    def of(self, outer: Array, members: slice = slice(None)) -> Array:
        """Scores (n, N) of taking each of ``outer`` (N, r, P) for each of the chosen, or of a slice of them.

        The exact change of the barrier (as a log) where :func:`is_exact`, else its first order.
        """
        m, k = self.weights
        inner = self.inner[members]
        if self.exact:
            table = m * swap_log_ratios(inner, outer, self.below)
            return table if k == 0 else table + k * swap_log_ratios(inner, outer, self.above, -1.0)
        return np.asarray(quadratic_form(outer, self.slope)[None, :] - quadratic_form(inner, self.slope)[:, None])

    @property
    def slope(self) -> Array:
        """Derivative of the barriers by the information, (P, P)."""
        return np.asarray(self.weights[0] * self.below - self.weights[1] * self.above)

    def of_each(self, members: Positions, trials: Array) -> Array:
        """Scores (m, T) of some of the chosen becoming each of their own ``trials`` (m, T, 1, P), where exact."""
        m, k = self.weights
        inner, outer = self.inner[members, 0], trials[:, :, 0]
        scores = m * trial_log_ratios(inner, outer, self.below)
        return scores if k == 0 else scores + k * trial_log_ratios(inner, outer, self.above, -1.0)

    def of_one(self, position: int, trials: Array) -> Array:
        """Scores (T,) of the chosen one at ``position`` becoming each of ``trials`` (T, r, P)."""
        return np.asarray(self.of(trials, slice(position, position + 1))[0])

    def exchange(self, position: int, row: Array) -> None:
        """Take ``row`` (1, P) for the chosen one at ``position`` (one reading a pose); the barriers stay in place."""
        for vector, sign in ((row[0], 1.0), (self.inner[position, 0], -1.0)):
            self.below = _add_to_inverse(self.below, vector, sign)
            self.above = _add_to_inverse(self.above, vector, -sign)
        self.inner[position] = row


def _add_to_inverse(inverse: Array, vector: Array, sign: float) -> Array:
    """Inverse of A + sign v v' from that of A (Sherman and Morrison)."""
    half = inverse @ vector
    return np.asarray(inverse - np.outer(half, half * (sign / (1.0 + sign * float(vector @ half)))))


def information_after(rows: Array, chosen: Positions, swaps: list[Swap]) -> Array:
    """Information matrices (k, P, P) after each of ``swaps``."""
    out = rows[chosen[[s.out for s in swaps]]]
    into = rows[[s.into for s in swaps]]
    change = np.swapaxes(into, 1, 2) @ into - np.swapaxes(out, 1, 2) @ out
    return np.asarray(information_matrix(rows[chosen]) + change)


@dataclass(frozen=True)
class PotentialCriterion:
    """Swaps between candidates ``rows`` (N, r, P) by a potential; only within a group where ``group`` (N,) is given."""

    rows: Array
    potential: BarrierPotential
    group: Positions | None = None

    def best_swap(self, chosen: Positions, outside: Positions) -> Swap | None:
        """Return the swap that betters the potential most, or None."""
        rows, potential = self.rows, self.potential
        exact = is_exact(rows, potential.index)
        if exact and potential.index == "O1":
            outside = self._prefilter(chosen, outside)
        swaps, scores = self.rank_swaps(chosen, outside, 1 if exact else TRIED_PAIRS)
        if exact or not swaps:
            return swaps[0] if swaps and scores[0] > LEAST_GAIN else None
        mu = eigenvalues(information_matrix(rows[chosen]))
        shifts = potential.shifts(mu)
        after = potential.barrier(eigenvalues(information_after(rows, chosen, swaps)), *shifts)
        gains = round_significant(after)
        best = int(np.argmax(gains))
        return swaps[best] if gains[best] > potential.barrier(mu, *shifts) + LEAST_GAIN else None

    def rank_swaps(self, chosen: Positions, outside: Positions, keep: int) -> tuple[list[Swap], Array]:
        """Return the ``keep`` most promising swaps that are allowed and their scores, best first."""
        if len(outside) == 0:
            return [], np.zeros(0)
        score = SwapTable(self.rows[chosen], self.potential)
        if not score.exact and self.group is None:
            outside = self._likely_newcomers(score, outside, keep)
        width = max(1, 2_000_000 // len(chosen))  # pairs scored at a time: 16 MB
        scores, places = [], []
        for k in range(0, len(outside), width):
            part = outside[k : k + width]
            table = score.of(self.rows[part])
            if self.group is not None:
                table[self.group[chosen][:, None] != self.group[part][None]] = -np.inf
            best = np.argpartition(-table, min(keep, table.size - 1), axis=None)[:keep]
            scores.append(table.ravel()[best])
            out, into = np.unravel_index(best, table.shape)
            places.append(np.stack([out, into + k], axis=1))
        found, place = np.concatenate(scores), np.concatenate(places)
        order = np.lexsort((place[:, 0], place[:, 1], -round_significant(found)))[:keep]
        order = order[found[order] > -np.inf]
        return [Swap(int(i), int(outside[j])) for i, j in place[order]], found[order]

    def _likely_newcomers(self, score: SwapTable, outside: Positions, keep: int) -> Positions:
        """Those that the ``keep`` best swaps are among, where a score is the difference of two candidates' gains."""
        if len(outside) <= keep:
            return outside
        most = 2 * len(outside) > len(self.rows)  # a copy of most rows costs more than what is not wanted
        gain = quadratic_form(self.rows if most else self.rows[outside], score.slope)
        gain = gain[outside] if most else gain
        return outside[np.sort(np.argpartition(-gain, keep - 1)[:keep])]

    def _prefilter(self, chosen: Positions, outside: Positions) -> Positions:
        """Return the candidates that can raise the determinant, by 1 + d_j - d_i at most (Cauchy-Schwarz)."""
        inverse = np.asarray(np.linalg.inv(information_matrix(self.rows[chosen])), dtype=float)
        return outside[quadratic_form(self.rows[outside], inverse) > np.min(quadratic_form(self.rows[chosen], inverse))]


@dataclass(frozen=True)
class IndexCriterion:
    """Swaps by the index itself, of those that tight and wide barriers single out."""

    rows: Array
    index: str

    def best_swap(self, chosen: Positions, outside: Positions) -> Swap | None:
        """Return the best swap among those that the first barrier singles out that finds a better one, or None."""
        index, now = find_rule(self.index), index_of_rows(self.index, self.rows[chosen])
        for strength in BARRIER_STRENGTHS[::-1]:
            potential = PotentialCriterion(self.rows, BarrierPotential(self.index, strength))
            swaps, _ = potential.rank_swaps(chosen, outside, TRIED_PAIRS)
            if not swaps:
                continue
            mass = information_after(self.rows, chosen, swaps)
            values = round_significant(index_of_information(self.index, mass, len(chosen)))
            best = int(np.argmax(index.merit(values)))
            if (index.gap(now, float(values[best])) if index.maximise else now / values[best] - 1) > LEAST_GAIN:
                return swaps[best]
        return None
