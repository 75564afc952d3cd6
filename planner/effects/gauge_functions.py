"""Basis functions of the gauge's own errors, on the reading: of a bar or wire of length L, or of a tracker's frame."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context


@dataclass(frozen=True)
class BarLength:
    """φ = L [m]: a scale error."""

    key = "length"

    def __call__(self, c: Context) -> Array:
        """Return the length."""
        return c.length


@dataclass(frozen=True)
class LengthPower:
    """φ = ((L − about)/span)^power: a scale that is bent over its range."""

    about: float
    span: float
    power: int

    @property
    def key(self) -> str:
        """``length-power:0.4:0.1:2``."""
        return f"length-power:{self.about!r}:{self.span!r}:{self.power}"

    def __call__(self, c: Context) -> Array:
        """Return the power."""
        return np.asarray(((c.length - self.about) / self.span) ** self.power)


@dataclass(frozen=True)
class LengthGrowth:
    """φ = (T − about)·L [K m]: thermal growth of the bar or of its scale."""

    about: float

    @property
    def key(self) -> str:
        """``growth:21.5``."""
        return f"growth:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        assert c.samples.temperature is not None
        return (c.samples.temperature - self.about) * c.length


@dataclass(frozen=True)
class LengthLag:
    """φ = −dL/dt [m/s]: a reading that comes late shows what was."""

    key = "length-lag"

    def __call__(self, c: Context) -> Array:
        """Return minus the rate."""
        return np.asarray(-np.einsum("ni,ni->n", c.velocity, c.bar.direction))


@dataclass(frozen=True)
class BallOffset:
    """φ = component of the bar's direction along an axis (0, 1, 2) of base or flange: a ball off its centre."""

    end: Literal["fixture", "tool"]
    axis: int

    @property
    def key(self) -> str:
        """``bar-tool:0``."""
        return f"bar-{self.end}:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        e = c.bar.direction
        return np.asarray(
            e[:, self.axis] if self.end == "fixture" else np.einsum("ni,in->n", e, c.motion.R[:, self.axis])
        )


@dataclass(frozen=True)
class BarSag:
    """φ = (L/span)³ · (1 − (e·g)²/g²): a wire or rod that hangs through under its own weight.

    The sag correction of surveyor's tapes, w² L³ cos²(slope) / (24 T²) (Ghilani & Wolf, Elementary Surveying, ch. 6).
    """

    span: float

    @property
    def key(self) -> str:
        """``sag:0.4``."""
        return f"sag:{self.span!r}"

    def __call__(self, c: Context) -> Array:
        """Return the shape of the correction."""
        down = c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        return np.asarray((c.length / self.span) ** 3 * (1.0 - (c.bar.direction @ down) ** 2))


@dataclass(frozen=True)
class ScaleWave:
    """φ = sin or cos(2π·reading/period) of the length as it was read: interpolation error of a scale."""

    wave: Literal["sin", "cos"]
    period: float

    @property
    def key(self) -> str:
        """``scale-sin:0.002``."""
        return f"scale-{self.wave}:{self.period!r}"

    def __call__(self, c: Context) -> Array:
        """Return the wave."""
        return np.asarray((np.sin if self.wave == "sin" else np.cos)(2 * np.pi / self.period * c.length))


@dataclass(frozen=True)
class GaugeRay:
    """φ = component, along an axis of the base, of the way from gauge to point [m]: scale of a tracker."""

    axis: int

    @property
    def key(self) -> str:
        """``ray:0``."""
        return f"ray:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        return c.ray[:, self.axis]


@dataclass(frozen=True)
class RayGrowth:
    """φ = (T − about) times the component of ``GaugeRay`` [K m]."""

    axis: int
    about: float

    @property
    def key(self) -> str:
        """``ray-growth:0:21.5``."""
        return f"ray-growth:{self.axis}:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        assert c.samples.temperature is not None
        return np.asarray((c.samples.temperature - self.about) * c.ray[:, self.axis])


@dataclass(frozen=True)
class PointLag:
    """φ = −velocity of the point along an axis of the base [m/s]: a tracker whose clock runs late."""

    axis: int

    @property
    def key(self) -> str:
        """``point-lag:0``."""
        return f"point-lag:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return minus the velocity."""
        return -c.velocity[:, self.axis]


@dataclass(frozen=True)
class BeamRefraction:
    """φ = component along an axis of the base of the bend of a light ray, upwards by its range squared [m²]."""

    axis: int

    @property
    def key(self) -> str:
        """``refraction:2``."""
        return f"refraction:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        up = -c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        return np.asarray(up[self.axis] * np.einsum("ni,ni->n", c.ray, c.ray))
