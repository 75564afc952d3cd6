"""How large errors of a kind are, learnt from what was seen of some of them: scaled inverse chi-square, by EM.

Each error x_i of a family is normal with the family's size s; before anything is seen s² is scaled-inverse-chi-square
with ν degrees of freedom about the size that such errors usually have (Gelman et al., Bayesian Data Analysis, 3rd ed.,
2.6 and 5.1). Where x_i is known with mean m_i and variance c_i, the likeliest s² solves (EM; Dempster, Laird and Rubin
1977, JRSS B 39(1))

    s² = (ν s₀² + Σ (m_i² + c_i)) / (ν + n)

in which what was not seen has c_i = s², and pulls nowhere.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from planner.common.units import Array

TRUST = 4.0  # [errors seen] that a usual size counts for: it is good to a factor of about two (1/sqrt(2 ν) of ln s)


@dataclass(frozen=True)
class LearntErrors:
    """Errors after some readings, in their usual sizes: mean and standard deviations (P,), learnt factors (F,)."""

    mean: Array
    std: Array
    factors: Array


def learn_errors(white: Array, seen: Array, family: np.ndarray, known: np.ndarray) -> LearntErrors:
    """Return what n readings say of P errors, and of how large those of each of F families are.

    Solved among the readings, (n, n): while a session is measured they are fewer than the errors.

    Args:
        white: the readings' rows W in standard deviations per usual size, (n, P).
        seen: the readings less what was expected of them, in standard deviations, (n,).
        family: of each error, (P,) int from 0.
        known: families whose size is stated and not learnt, (F,) bool.
    """
    count = np.bincount(family, minlength=len(known))
    square = np.ones(len(known))
    for _ in range(60):  # rounds: each takes a part of the way, most of it in the first ones
        variance = square[family]
        root = np.linalg.cholesky(np.eye(len(white)) + (white * variance) @ white.T)
        mean = variance * (white.T @ cho_solve((root, True), seen))
        told = variance**2 * (solve_triangular(root, white, lower=True) ** 2).sum(axis=0)
        left = np.maximum(variance - told, 0.0)
        held = np.bincount(family, mean**2 + left, minlength=len(known))
        new = np.where(known, 1.0, (TRUST + held) / (TRUST + count))
        change = np.abs(np.log(new / square)).max()
        square = new
        if change < 1e-3:
            break
    return LearntErrors(np.asarray(mean), np.asarray(np.sqrt(left)), np.asarray(np.sqrt(square)))


@dataclass(frozen=True)
class LearntSizes:
    """Sizes of families from estimates of their errors, over the usual ones.

    Attributes:
        factors: (F,).
        seen: how many errors the estimates show, (F,): one that is known well counts one, one that is not none.
    """

    factors: Array
    seen: Array

    @property
    def log_std(self) -> Array:
        """One standard deviation of the logarithm of each factor, (F,): 1/sqrt(2 (ν + seen))."""
        return np.asarray(1.0 / np.sqrt(2.0 * (TRUST + self.seen)))


def learn_sizes(value: Array, std: Array, family: np.ndarray, count: int) -> LearntSizes:
    """Return the sizes of families of which some errors were estimated, each by itself.

    Args:
        value: estimates over the usual size, (n,), as the readings alone say: no prior drew them in.
        std: their standard deviations over the usual size, (n,).
        family: of each, (n,) int from 0 to ``count`` − 1.
        count: of families F.
    """
    square = np.ones(count)
    number = np.bincount(family, minlength=count)
    for _ in range(500):  # rounds
        own = square[family]
        left = own * std**2 / (own + std**2)
        mean = value * own / (own + std**2)
        new = (TRUST + np.bincount(family, mean**2 + left, minlength=count)) / (TRUST + number)
        change = np.abs(np.log(new / square)).max(initial=0.0)
        square = new
        if change < 1e-6:
            break
    own = square[family]
    seen = np.bincount(family, (own / (own + std**2)) ** 2, minlength=count)
    return LearntSizes(np.asarray(np.sqrt(square)), np.asarray(seen, dtype=float))
