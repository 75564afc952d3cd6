"""What the tests of a residual say."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Trial:
    """One test: along what, how likely chance is after Bonferroni, rms of what follows it [m]."""

    along: str
    p_value: float
    rms: float


@dataclass(frozen=True)
class Leftover:
    """What all tests of the last stage's residual said.

    Attributes:
        trials: all of them, in order; empty where the run is too small.
        found: those that are not chance, the largest first.
        rms: of what follows all of ``found`` together [m].
        sentence: the same in words.
    """

    trials: tuple[Trial, ...]
    found: tuple[Trial, ...]
    rms: float
    sentence: str

    @property
    def structured(self) -> bool:
        """Whether the residual is not chance."""
        return bool(self.found)
