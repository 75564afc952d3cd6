"""A smooth stand-in for an index, exact for swaps: barriers below the smallest and above the largest eigenvalue.

With information matrix M and eigenvalues lambda, the logarithm of kappa^2 is the least log(u / l) with
l I <= M <= u I. The potential adds barriers to it,

    f(M) = min over l, u of  log u - b log l - m log det(M / l - I) - k log det(I - M / u)

and tends to the index as m and k fall to zero (b = 1 for O2, 2 for O4; O3 has the lower half alone; O1 is l = 0). Two
things make it the right tool for exchanges: at fixed l and u a swap changes it by a ratio of small determinants, known
exactly for all pairs at the price of one matrix product; and the minimum over l and u makes that change an upper bound,
so every swap that looks better is better. Barriers of this kind: Batson, Spielman and Srivastava 2012.
"""

from dataclasses import dataclass

import numpy as np

from planner.units import Array

_LOWER = {"O2": 1.0, "O3": 1.0, "O4": 2.0}
_UPPER = ("O2", "O4")
_UPPER_SHARE = 0.15  # few eigenvalues crowd at the top, many at the bottom: the upper barrier wants another weight
_NEWTON = 25


@dataclass(frozen=True)
class Potential:
    """The stand-in for ``index``; ``strength`` (0 to 1) is how much the barriers weigh."""

    index: str
    strength: float

    def weights(self, size: int) -> tuple[float, float]:
        """Return the barrier weights (m, k) for ``size`` parameters."""
        if self.index not in _LOWER:
            return 1.0, 0.0
        return self.strength / size, _UPPER_SHARE * self.strength if self.index in _UPPER else 0.0

    def shifts(self, mu: Array) -> tuple[float, float]:
        """Return the best l and u for eigenvalues ``mu`` (P,), ascending; l 0 and u inf where a half is missing."""
        m, k = self.weights(len(mu))
        lower, upper = 0.0, np.inf
        if self.index in _LOWER:
            lower = _lower_shift(mu, m, _LOWER[self.index] - m * len(mu))
        if k > 0:
            upper = _upper_shift(mu, k, 1.0 + k * len(mu))
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


def _lower_shift(mu: Array, m: float, rest: float) -> float:
    """Solve m sum l / (mu - l) = rest by Newton from above: convex and increasing, so it comes down monotonely."""
    at = float(mu[0]) * rest / (rest + m)
    for _ in range(_NEWTON):
        inverse = 1.0 / (mu - at)
        miss = m * at * float(np.sum(inverse)) - rest
        if miss <= 1e-9 * rest:
            break
        at -= miss / (m * float(np.sum(mu * inverse**2)))
    return at


def _upper_shift(mu: Array, k: float, total: float) -> float:
    """Solve k sum 1 / (1 - v mu) = total for v = 1 / u, in the same way."""
    at = (1.0 - k / total) / float(mu[-1])
    for _ in range(_NEWTON):
        inverse = 1.0 / (1.0 - at * mu)
        miss = k * float(np.sum(inverse)) - total
        if miss <= 1e-9 * total:
            break
        at -= miss / (k * float(np.sum(mu * inverse**2)))
    return 1.0 / at
