"""No set of as many candidates leaves a smaller error than this.

Two proofs, of which the better one counts. Fractions of readings: the mean square error trace(W (1 + Σ wᵢ aᵢᵀ aᵢ)⁻¹)
is convex in the weights w of the readings (Boyd & Vandenberghe 2004, 7.5.2), so that its tangent at any w lies below it
everywhere; over weights in [0, 1] that sum to n the tangent is least at a corner, which is found by sorting. And n
readings teach at most n directions: the error along all others stays as it was before.
"""

import numpy as np

from planner.units import Array

STEPS = 10  # they bring the bound to a part in thirty of what more of them would prove
POWER = (
    0.8  # of a reading's gain in the step of its weight (multiplicative algorithm; Silvey, Titterington & Torsney 1978)
)
HEAD = 0.7  # share of the weight that the given set starts with


def least_error(white: Array, weight: Array, chosen: np.ndarray) -> float:
    """Return a lower bound of the error [m] that any ``len(chosen)`` candidates leave.

    Args:
        white: rows of the candidates in standard deviations of their readings per prior size, (m, P).
        weight: mean square error per squared errors in prior sizes, (P, P).
        chosen: a good set, from which the search starts, (n,) int.
    """
    count, best = len(chosen), 0.0
    w = np.full(len(white), (1 - HEAD) * count / len(white))
    w[chosen] += HEAD
    for _ in range(STEPS):
        covariance = np.linalg.inv((white.T * w) @ white + np.eye(white.shape[1]))
        gain = np.einsum("ij,ij->i", white @ (covariance @ weight @ covariance), white)
        corner = np.sort(gain)[-count:].sum()
        best = max(best, float((weight * covariance).sum() - corner + gain @ w))
        w = _capped(w * gain**POWER, count)
    size = np.sort(np.linalg.eigvalsh(weight))
    untaught = float(np.maximum(size[: max(len(size) - count, 0)], 0.0).sum())
    return float(np.sqrt(max(best, untaught)))


def _capped(wanted: Array, count: int) -> Array:
    """Weights in proportion to what is wanted, none above one, that sum to ``count``."""
    full = np.zeros(len(wanted), dtype=bool)
    while True:
        out = np.where(full, 1.0, wanted * ((count - full.sum()) / wanted[~full].sum()))
        more = out > 1.0 + 1e-12
        if not more.any():
            return out
        full |= more
