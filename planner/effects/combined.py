"""Basis functions made of others."""

from dataclasses import dataclass

from planner.effects.basis import Phi
from planner.effects.context import Context
from planner.units import Array


@dataclass(frozen=True)
class Times:
    """φ times a number."""

    phi: Phi
    factor: float

    @property
    def key(self) -> str:
        """``times:0.86:warmth:21.5``."""
        return f"times:{self.factor!r}:{self.phi.key}"

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        return self.factor * self.phi(c)
