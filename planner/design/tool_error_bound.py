"""A proven bound on the error of the tool that any choice of candidates leaves, by weights of all of them."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from planner.common.determinism import Positions
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array
from planner.design.selection.certificate import ActiveSet, Dual, Pricing, generate_columns
from planner.design.selection.matrix_forms import quadratic_form, sum_largest
from planner.design.selection.search import highest_priced_candidates


@dataclass(frozen=True)
class ErrorTangent:
    """A proof for the mean square error trace(W M⁻¹), M = 1 + Σ wᵢ aᵢᵀ aᵢ, by any symmetric matrix X.

    M⁻¹ − 2 X + X M X = (M^−½ − X M^½)(M^−½ − X M^½)ᵀ is positive semidefinite, so that trace(W M⁻¹) is at least
    2 trace(W X) − trace(X W X M), whatever X is. With X = M⁻¹ it is the tangent of the error, convex in w (Boyd and
    Vandenberghe 2004, 7.5.2). Over weights in [0, 1] that sum to ``poses`` it is least at a corner, found by sorting.
    """

    inverse: Array
    weight: Array
    poses: int
    upper: ClassVar[bool] = False

    def verify(self, rows: Array) -> float:
        """Return the mean square error [m²] that any as many readings leave at least."""
        before = 2.0 * float((self.weight * self.inverse).sum()) - float(np.trace(self._slope))
        return before - sum_largest(-self.prices(rows), self.poses)

    def prices(self, rows: Array, active: Positions | None = None) -> Array:
        """Return the price (n,) of each candidate: minus what its reading would take off the mean square error."""
        return -quadratic_form(rows, self._slope)

    @property
    def _slope(self) -> Array:
        return np.asarray(self.inverse @ self.weight @ self.inverse)


@dataclass(frozen=True)
class ErrorPricing(Pricing):
    """The relaxation of the tool's error over weights of all readings: rows (n, 1, P) and ``weight`` W (P, P)."""

    weight: Array

    def solve(self, state: ActiveSet, accuracy: float) -> tuple[ActiveSet, Dual, float]:
        """Return the tangent at the weights as they are."""
        white = self.rows[:, 0]
        inverse = np.linalg.inv((white.T * state.weights) @ white + np.eye(white.shape[1]))
        return state, ErrorTangent((inverse + inverse.T) / 2, self.weight, self.count), np.inf

    def distance(self, relaxed: float, bound: float) -> float:
        """Return infinity: every round is done."""
        return relaxed

    def grow(self, state: ActiveSet, dual: Dual) -> ActiveSet:
        """Give weight to readings that gain much."""
        gain = -dual.prices(self.rows, state.active)
        # 0.8: of a reading's gain (Silvey, Titterington and Torsney 1978)
        return ActiveSet(state.active, _cap_weights(state.weights * gain**0.8, self.count))


def bound_tool_error(white: Array, weight: Array, chosen: np.ndarray, limit: TimeLimit = UNLIMITED) -> float:
    """Return a lower bound of the error [m] that any ``len(chosen)`` candidates leave.

    Two proofs, of which the better one counts: the tangent, and that n readings teach at most n directions, the error
    along all others stays as it was before.

    Args:
        white: rows of the candidates in standard deviations of their readings per prior sigma, (m, P).
        weight: mean square error per squared errors in prior sigmas, (P, P).
        chosen: a good set, from which the search starts, (n,) int.
    """
    share = 0.7  # of the weight that the given set starts with
    count, rows = len(chosen), white[:, None]
    w = np.full(len(white), (1 - share) * count / len(white))
    w[chosen] += share
    every = ErrorPricing(rows, count, "I", limit, weight)
    _, begun, _ = every.solve(ActiveSet(np.arange(len(white)), w), 0.0)
    # 6000: readings among which the bound is tightened; it is verified over all of them
    active = np.union1d(
        chosen, highest_priced_candidates(-begun.prices(rows, np.arange(len(rows))), min(6000, len(white)))
    )
    few = replace(every, rows=rows[active])
    state = ActiveSet(np.arange(len(active)), _cap_weights(w[active], count))
    # 10: steps bring the bound to a part in thirty of what more would prove
    best = generate_columns(few, state, 0.0, 0.0, 10).duals[0].verify(rows)
    size = np.sort(np.linalg.eigvalsh(weight))
    untaught = float(np.maximum(size[: max(len(size) - count, 0)], 0.0).sum())
    return float(np.sqrt(max(best, untaught, 0.0)))


def _cap_weights(wanted: Array, count: int) -> Array:
    """Weights in proportion to what is wanted, none above one, that sum to ``count``."""
    full = np.zeros(len(wanted), dtype=bool)
    while True:
        out = np.where(full, 1.0, wanted * ((count - full.sum()) / wanted[~full].sum()))
        more = out > 1.0 + 1e-12
        if not more.any():
            return out
        full |= more
