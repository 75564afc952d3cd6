"""Basis functions that come again with the turns of a joint: encoders, gears, bearings."""

from dataclasses import dataclass

import numpy as np

from planner.effects.context import Context
from planner.units import Array


@dataclass(frozen=True)
class Sine:
    """φ = sin(f·q) of a joint's angle q as read; f waves in one turn of the joint, any number."""

    joint: int
    frequency: float

    @property
    def key(self) -> str:
        """``sin:3:12.5`` for joint 3."""
        return f"sin:{self.joint + 1}:{self.frequency!r}"

    def __call__(self, c: Context) -> Array:
        """Return the sine."""
        return np.asarray(np.sin(self.frequency * c.samples.q[:, self.joint]))


@dataclass(frozen=True)
class Cosine:
    """φ = cos(f·q) of a joint's angle q as read; f waves in one turn of the joint, any number."""

    joint: int
    frequency: float

    @property
    def key(self) -> str:
        """``cos:3:12.5`` for joint 3."""
        return f"cos:{self.joint + 1}:{self.frequency!r}"

    def __call__(self, c: Context) -> Array:
        """Return the cosine."""
        return np.asarray(np.cos(self.frequency * c.samples.q[:, self.joint]))


@dataclass(frozen=True)
class Angle:
    """φ = q − about [rad] of a joint as read: a wrong ratio, or the coupling of another joint to this one."""

    joint: int
    about: float

    @property
    def key(self) -> str:
        """``angle:3:0.5`` for joint 3."""
        return f"angle:{self.joint + 1}:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the angle."""
        return np.asarray(c.samples.q[:, self.joint] - self.about)
