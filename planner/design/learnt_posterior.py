"""What some readings leave of the tool's error in a linear model, the sizes of its errors learnt from these readings.

Everything is asked of a set of readings, of which only those that were taken have taught the sizes: so further ones are
foreseen by the sizes as known now.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.expected_errors import limit_of_sum
from planner.design.learnt_sizes import Families, LearntErrors, learn_errors
from planner.model.linear_gaussian import LinearGaussian


@dataclass
class LearntPosterior:
    """A linear model whose errors belong to families of sizes that are learnt.

    Attributes:
        white: Jacobian of all readings that may be taken, (n, P). A row is divided by the reading's standard deviation,
            a column multiplied by the usual size of its error.
        root: R, (P, r), with which R Rᵀ maps squared errors to the mean square error of the tool [m²].
        families: which errors share a size.
        learnt: what the readings taken say.
    """

    white: Array
    root: Array
    families: Families
    learnt: LearntErrors

    def __post_init__(self) -> None:
        self._weigh()

    def _weigh(self) -> None:
        """Take the sizes as they are learnt into what is known before any reading."""
        root = self.root * self.size[:, None]
        self._before: Array = root.T @ root  # before any reading, with the sizes as learnt; asked for many sets

    @classmethod
    def of(cls, white: Array, weight: Array, families: Families) -> "LearntPosterior":
        """Return the posterior before any reading; errors e (P,) make the tool's square error eᵀ ``weight`` e [m²]."""
        return cls(white, root_of(weight), families, LearntErrors.usual(white.shape[1], len(families)))

    @property
    def size(self) -> Array:
        """Sizes of the errors over the usual ones, (P,)."""
        return np.asarray(self.learnt.factors[self.families.number])

    def learn(self, taken: Sequence[int], off: Array) -> None:
        """Learn from readings ``taken``, less what was expected of them, in standard deviations, (k,)."""
        self.learnt = learn_errors(self.white[list(taken)], off, self.families)
        self._weigh()

    def spread_of(self, reading: int, taken: Sequence[int]) -> float:
        """Return the variance of a reading that is expected after those ``taken``, its noise included, in its own."""
        own = self.white[[reading]]
        left = (own * self.size) @ (own * self.size).T - self.model(taken).reduction(own)
        return self.learnt.noise**2 + float(max(left[0, 0], 0.0))

    def model(self, which: Sequence[int]) -> LinearGaussian:
        """Return the linear model of some readings, with the sizes and the noise as learnt."""
        white = self.white[list(which)]
        return LinearGaussian(white, self.size, np.full(len(white), self.learnt.noise))

    def remaining_error(self, which: Sequence[int]) -> Array:
        """Return the matrix whose trace is the mean square error of the tool after some readings, (r, r) [m²].

        It is Rᵀ C R, with R the root of the weight and C the covariance that the readings leave.
        """
        return np.asarray(self._before - self.model(which).reduction(self.root.T))

    def square(self, which: Sequence[int]) -> float:
        """Return the mean square error of the tool after some readings [m²]."""
        return float(np.trace(self.remaining_error(which))) * float(np.exp(2.0 * self.families.doubt**2))

    def square_error_limit(self, which: Sequence[int]) -> float:
        """Return the square that 95 of 100 such robots stay below after some readings [m²]."""
        values = np.maximum(np.linalg.eigvalsh(self.remaining_error(which))[::-1], 0.0)
        most = 60  # values that vary; the small ones that are left count as certain
        return limit_of_sum(values[:most], float(values[most:].sum()), self.families.doubt)


def root_of(weight: Array) -> Array:
    """Return a root (P, r) of a symmetric matrix, without what adds nothing to its trace."""
    values, axes = np.linalg.eigh(weight)
    kept = values > 1e-9 * values.sum()
    return np.asarray(axes[:, kept] * np.sqrt(values[kept]))
