"""Joint compliances with what each of them, and each combination of them, is worth."""

from dataclasses import dataclass

import numpy as np

from planner.observability.sentences import written
from planner.units import Array

WORTH = 0.05  # of the largest share of a combination: less is not written out, and hides no joint behind another
KNOWN, OPEN = 1.0 / 3.0, 1.0  # standard deviation as a part of the prior size: below known, above not known at all
SHARED = OPEN / np.sqrt(2.0)  # the same with the prior, where the readings say no more than was known before
WELL, HARDLY, UNTOLD = "known", "hardly known", "not learnt"


@dataclass(frozen=True)
class Combination:
    """One direction of the compliances, in prior sizes: ``shares`` (N,) of unit length, ``std`` as a part of them."""

    names: tuple[str, ...]
    shares: Array
    std: float

    @property
    def told(self) -> str:
        """What the readings alone say of it: known, hardly known, or not learnt (more is open than was before)."""
        return WELL if self.std < KNOWN else HARDLY if self.std <= OPEN else UNTOLD

    @property
    def text(self) -> str:
        """The direction in words, largest share first; c2 is compliance2, alone where the others hardly count."""
        largest = float(abs(self.shares).max())
        pairs = [
            (n.replace("compliance", "c"), float(s))
            for n, s in zip(self.names, self.shares, strict=True)
            if abs(s) > WORTH * largest
        ]
        if len(pairs) == 1:
            return pairs[0][0]
        return written(sorted(pairs, key=lambda pair: -round(abs(pair[1]), 9)))


@dataclass(frozen=True)
class Compliances:
    """Joint compliances as the deflections tell them.

    Attributes:
        names: ``compliance1`` …
        value, std: with the prior, (N,) [rad/Nm].
        prior: one-sigma sizes before the measurement, (N,) [rad/Nm].
        information: of the deflections alone, (N, N) [(Nm/rad)²]; ``pulled`` is ``information`` times their own
            estimate, (N,) [Nm/rad].
        combinations: from the best known to the least.
        noise: standard deviation of one averaged reading, by the repeats where there are some [m].
        misfit: how many times more the loads' curves differ than the repeats do; 1 where all is as modelled.
    """

    names: tuple[str, ...]
    value: Array
    std: Array
    prior: Array
    information: Array
    pulled: Array
    combinations: tuple[Combination, ...]
    noise: float
    misfit: float

    @property
    def told(self) -> tuple[str, ...]:
        """Of each joint's compliance by itself, (N,): known, hardly known, or not learnt (the prior says more)."""
        share = self.std / self.prior
        return tuple(WELL if s < KNOWN else HARDLY if s < SHARED else UNTOLD for s in share)

    @property
    def known(self) -> tuple[Combination, ...]:
        """Combinations known to a third of their prior size or better."""
        return tuple(c for c in self.combinations if c.std < KNOWN)

    @property
    def unknown(self) -> tuple[Combination, ...]:
        """Combinations of which the deflections say less than was known before."""
        return tuple(c for c in self.combinations if c.std > OPEN)
