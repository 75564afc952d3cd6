"""What the search hands from step to step."""

from dataclasses import dataclass

from planner.catalogue import Entry


@dataclass(frozen=True)
class Candidate:
    """An entry of the catalogue at one value of its inner number, and what it would explain.

    Attributes:
        entry, inner: which.
        gain: fall of the whitened sum of squares by its parameters, after the model has taken what it can.
        size: number of its parameters that the readings show.
        log_p: logarithm of the chance of so large a gain, corrected for everything that was tried.
        score: gain in noise variances less what parameters and inner numbers explain by being many.
    """

    entry: Entry
    inner: float | None
    gain: float
    size: int
    log_p: float
    score: float
