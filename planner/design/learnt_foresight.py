"""What further readings are likely to leave of the tool's error, where sizes are learnt from the readings themselves.

While few readings are taken the size of a family is an average over robots in which it acts and many in which it does
not. Further readings tell these apart, so the sizes shrink on most robots. Foreseen with the sizes as they stand now, a
session would seem to need many more readings than it does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array
from planner.design.learnt_posterior import LearntPosterior
from planner.design.learnt_sizes import learn_errors
from planner.model.linear_gaussian import LinearGaussian


@dataclass(frozen=True)
class LearntForesight:
    """The posterior as it is likely to be after some of the readings that may follow.

    The readings that may follow are drawn once, of a robot whose families have their typical sizes, and the sizes are
    learnt from them all. In between, the logarithm of a size goes evenly with the logarithm of the number of readings.

    Attributes:
        now: what the readings taken say.
        taken: these, then those that may follow, in their order.
        count: how many are taken.
        factors: sizes of the families once all are taken, (F,).
        noise: of a reading then, over the one that is declared.
    """

    now: LearntPosterior
    taken: tuple[int, ...]
    count: int
    factors: Array
    noise: float

    @classmethod
    def of(cls, now: LearntPosterior, taken: Sequence[int], off: Array, more: Sequence[int]) -> "LearntForesight":
        """Return the foresight after readings ``taken`` with the deviations ``off`` (k,) when ``more`` may follow."""
        every = (*taken, *more)
        if not more:
            return cls(now, every, len(taken), now.learnt.factors, now.learnt.noise)
        drawn = np.append(off, draw_readings(now, taken, off, more))
        then = learn_errors(now.white[list(every)], drawn, now.families, now.learnt)
        return cls(now, every, len(taken), then.factors, then.noise)

    def after(self, more: int) -> LearntPosterior:
        """Return the posterior that is expected after so many of the readings that may follow."""
        if more == 0:
            return self.now
        learnt, first = self.now.learnt, self.count + 1  # 1: the usual sizes are known before any reading
        share = np.log((first + more) / first) / np.log((1 + len(self.taken)) / first)
        now, then = (np.log(np.maximum(f, 1e-6)) for f in (learnt.factors, self.factors))  # 1e-6: of none
        noise = learnt.noise * (self.noise / learnt.noise) ** share
        sizes = replace(learnt, factors=np.exp(now + share * (then - now)), noise=float(noise))
        return replace(self.now, learnt=sizes)

    def square(self, more: int) -> float:
        """Return the mean square error of the tool [m²] that is expected after so many more."""
        return self.after(more).square(self.taken[: self.count + more])

    def square_error_limit(self, more: int) -> float:
        """Return the square [m²] that 95 of 100 such robots are expected to stay below after so many more."""
        return self.after(more).square_error_limit(self.taken[: self.count + more])


def draw_readings(now: LearntPosterior, taken: Sequence[int], off: Array, more: Sequence[int]) -> Array:
    """Draw readings ``more`` [standard deviations] of a robot of typical sizes that agrees with those taken, (m,).

    Errors are drawn before any reading and then moved by what the readings differ from those drawn (Matheron's rule;
    Journel and Huijbregts 1978, Mining Geostatistics).
    """
    seed = 5  # fixed: the same readings foresee the same
    rng = np.random.default_rng(seed)
    size, noise = now.learnt.typical[now.families.number], now.learnt.noise
    errors = size * rng.standard_normal(len(size))
    seen, ahead = now.white[list(taken)], now.white[list(more)]
    gap = off - seen @ errors - noise * rng.standard_normal(len(off))
    errors = errors + LinearGaussian(seen, size, np.full(len(seen), noise)).mean(gap)
    return np.asarray(ahead @ errors + noise * rng.standard_normal(len(ahead)))
