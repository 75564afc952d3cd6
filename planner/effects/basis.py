"""Basis functions φ of an effect: what multiplies a parameter, sample by sample (value = nominal + Σ φ·p)."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context


class Phi(Protocol):
    """A basis function; ``key`` is its name in files, and tells it from every other."""

    @property
    def key(self) -> str:
        """Name in files, for instance ``torque:2``."""
        ...

    def __call__(self, c: Context) -> Array:
        """Return φ for every sample, (n,) or (1,)."""
        ...


@dataclass(frozen=True)
class One:
    """φ = 1: a geometric error, an offset of the gauge."""

    key = "1"

    def __call__(self, c: Context) -> Array:
        """Return one."""
        return np.ones(1)


@dataclass(frozen=True)
class AtPlace:
    """φ = ±1 where the gauge stands at this place (fixture, plate, station), else 0."""

    place: int
    sign: float = 1.0

    @property
    def key(self) -> str:
        """``place:0`` for the first."""
        return f"place:{self.place}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.where(c.samples.place == self.place, self.sign, 0.0)


@dataclass(frozen=True)
class AtPoint:
    """φ = 1 where this target on the tool was measured, else 0."""

    point: int

    @property
    def key(self) -> str:
        """``point:0`` for the first."""
        return f"point:{self.point}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        point = c.samples.point
        return np.full(1, float(self.point == 0)) if point is None else (point == self.point).astype(float)


@dataclass(frozen=True)
class LoadTorque:
    """φ = torque [Nm] with which gravity, payload and the bar turn this joint, in the sense of its kinematic row.

    A parameter on the joint's own rotation with this φ is its compliance [rad/Nm] (TriCal paper, c2 … c6).
    """

    joint: int

    @property
    def key(self) -> str:
        """``torque:2`` for joint 2."""
        return f"torque:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return the load torque."""
        return c.load_torque[:, self.joint]


ONE = One()


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
