"""No set of as many candidates leaves a smaller error than this.

Two proofs, of which the better one counts. Fractions of readings: the mean square error trace(W (1 + Σ wᵢ aᵢᵀ aᵢ)⁻¹)
is convex in the weights w of the readings (Boyd & Vandenberghe 2004, 7.5.2), so that its tangent at any w lies below it
everywhere; over weights in [0, 1] that sum to n the tangent is least at a corner, which is found by sorting. And n
readings teach at most n directions: the error along all others stays as it was before.
"""

import numpy as np

from planner.units import Array

ROUNDS = 4  # in each the tangent is held against all candidates, and those that promise most come in
WIDER = 4  # times as many come in as are chosen
STEPS = 15
POWER = (
    0.8  # of a reading's gain in the step of its weight (multiplicative algorithm; Silvey, Titterington & Torsney 1978)
)
HEAD = 0.7  # share of the weight that stays where it is when others come in


def least_error(white: Array, weight: Array, chosen: np.ndarray) -> float:
    """Return a lower bound of the error [m] that any ``len(chosen)`` candidates leave.

    Args:
        white: rows of the candidates in standard deviations of their readings per prior size, (m, P).
        weight: mean square error per squared errors in prior sizes, (P, P).
        chosen: a good set, from which the search starts, (n,) int.
    """
    count, best = len(chosen), 0.0
    active, w = np.sort(chosen), np.ones(len(chosen))
    for _ in range(ROUNDS):
        value, slope = _tangent(white[active], w, weight)
        gain = np.einsum("ij,ij->i", white @ slope, white)
        order = np.argsort(-gain, kind="stable")
        best = max(best, value - float(gain[order[:count]].sum()) + float(gain[active] @ w))
        more = np.setdiff1d(order[: WIDER * count], active)
        if len(more):
            active, w = np.append(active, more), np.append(HEAD * w, np.full(len(more), (1 - HEAD) * count / len(more)))
        for _ in range(STEPS):
            slope = _tangent(white[active], w, weight)[1]
            w = _capped(w * np.einsum("ij,ij->i", white[active] @ slope, white[active]) ** POWER, count)
    size = np.sort(np.linalg.eigvalsh(weight))
    untaught = float(np.maximum(size[: max(len(size) - count, 0)], 0.0).sum())
    return float(np.sqrt(max(best, untaught)))


def _tangent(white: Array, w: Array, weight: Array) -> tuple[float, Array]:
    """Mean square error of readings with weights w (k,), and the matrix whose products with a row are its gain."""
    covariance = np.linalg.inv((white.T * w) @ white + np.eye(white.shape[1]))
    return float((weight * covariance).sum()), covariance @ weight @ covariance


def _capped(wanted: Array, count: int) -> Array:
    """Weights in proportion to what is wanted, none above one, that sum to ``count``."""
    full = np.zeros(len(wanted), dtype=bool)
    while not full.all():
        out = np.where(full, 1.0, wanted * ((count - full.sum()) / wanted[~full].sum()))
        more = out > 1.0 + 1e-12
        if not more.any():
            return out
        full |= more
    return np.ones(len(wanted))
