"""Basis functions of heat and time; what they are counted from is a number of its own, frozen with the effect."""

from dataclasses import dataclass

import numpy as np

from planner.effects.context import Context
from planner.units import Array


@dataclass(frozen=True)
class Warmth:
    """φ = temperature − about [K]."""

    about: float

    @property
    def key(self) -> str:
        """``warmth:21.5``."""
        return f"warmth:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        assert c.samples.temperature is not None
        return c.samples.temperature - self.about


@dataclass(frozen=True)
class Elapsed:
    """φ = time since ``start`` [s]."""

    start: float

    @property
    def key(self) -> str:
        """``elapsed:0.0``."""
        return f"elapsed:{self.start!r}"

    def __call__(self, c: Context) -> Array:
        """Return the time."""
        assert c.samples.t is not None
        return c.samples.t - self.start


@dataclass(frozen=True)
class WarmUp:
    """φ = 1 − exp(−(t − start)/τ): one body that warms up to a new balance (Newton's law of cooling)."""

    start: float
    constant: float

    @property
    def key(self) -> str:
        """``warm-up:0.0:900.0``."""
        return f"warm-up:{self.start!r}:{self.constant!r}"

    def __call__(self, c: Context) -> Array:
        """Return the part of the way that is done."""
        assert c.samples.t is not None
        return np.asarray(-np.expm1(-(c.samples.t - self.start) / self.constant))


@dataclass(frozen=True)
class InSession:
    """φ = 1 in one session, else 0."""

    session: int

    @property
    def key(self) -> str:
        """``session:2``."""
        return f"session:{self.session}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray(c.samples.session == self.session, dtype=float)


@dataclass(frozen=True)
class Remounted:
    """φ = 1 at one place in one session, else 0: where a fixture stands after it was mounted anew."""

    place: int
    session: int

    @property
    def key(self) -> str:
        """``remounted:0:2``."""
        return f"remounted:{self.place}:{self.session}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray((c.samples.session == self.session) & (c.samples.place == self.place), dtype=float)
