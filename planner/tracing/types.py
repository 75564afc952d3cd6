"""What the tracer hands over: findings, what it could not name, and what it would have seen."""

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
    """

    entry: Entry
    inner: float | None
    gain: float
    size: int
    log_p: float


@dataclass(frozen=True)
class Finding:
    """An effect that the run shows, in SI units.

    Attributes:
        entry, inner, inner_std: what, and the number inside it with its standard deviation.
        value, std: size of the effect (length of its parameters' vector), in ``unit``.
        p_value: of the effect by chance, in the final model, corrected for everything that was tried.
        held_out_gain: fall of the root mean square error on held-out samples when it was added [m].
        rivals: names of other entries that explain the same within uncertainty.
        note: what a mechanic would say.
    """

    entry: Entry
    inner: float | None
    inner_std: float | None
    value: float
    std: float
    unit: str
    p_value: float
    held_out_gain: float
    rivals: tuple[str, ...]
    note: str


@dataclass(frozen=True)
class Limit:
    """The smallest size of an effect that this run would have shown in 95 of 100 cases, in the unit of the entry."""

    name: str
    size: float
    unit: str
