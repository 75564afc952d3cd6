"""What is wrong with an arm and its cell: geometric errors, effects and noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from scipy.signal import lfilter

from tests.simulation.generator.kinds import Effect

SHAPES = ("white", "heavy", "correlated")


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one reading [m] and of one joint's coming to rest [rad]; ``shape`` of both.

    ``heavy``: Student's t with 3 degrees of freedom; ``correlated``: each sample keeps ``memory`` of the one before.
    In a continuous run the joints' part is always correlated, over ``wander_s``.
    """

    gauge: float = 3e-6
    joint: float = 4e-6
    shape: str = "white"
    memory: float = 0.8
    wander_s: float = 0.2

    def draw(self, rng, n, k, memory=None):
        """Samples (n, k) of unit variance."""
        heavy = self.shape == "heavy"
        white = rng.standard_t(3, (n, k)) / np.sqrt(3) if heavy else rng.standard_normal((n, k))
        memory = memory if memory is not None else (self.memory if self.shape == "correlated" else 0.0)
        return remembering(white, memory)


def remembering(white, memory):
    """First-order autoregressive series of unit variance from white noise (n, k)."""
    if memory == 0.0:
        return white
    start = white[:1] * memory
    fresh = np.sqrt(1 - memory**2)
    out, _ = lfilter([fresh], [1.0, -memory], white, axis=0, zi=start)
    return out


@dataclass(frozen=True)
class Truth:
    """The truth of one run.

    ``errors``: true minus nominal [m or rad] by name: DH names, ``map_x``…, ``fixture_A_x``…, ``zero``.
    ``mass_factor``: true over stated mass of each link. ``effects``: see ``catalogue``.
    """

    seed: int
    errors: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    effects: tuple[Effect, ...] = ()
    noise: Noise = Noise()
    mass_factor: tuple[float, ...] = ()

    def error(self, prefix):
        """The error (3,) [m] of a point named ``prefix_x``, ``_y``, ``_z``."""
        return np.array([self.errors.get(f"{prefix}_{x}", 0.0) for x in "xyz"])

    def of_arm(self, arm):
        """The errors that move slots of the arm."""
        return {k: v for k, v in self.errors.items() if k in set(arm.names)}


def draw_errors(arm, rng, length=4e-4, angle=5e-4, tool=4e-4, place=2e-3):
    """Random geometric errors: a few millimetres at the flange, and a cell that is known to ``tool``, ``place`` [m]."""
    errors = {}
    for name in arm.geometry:
        turns = arm.slots[arm.names.index(name)].turns
        errors[name] = float(rng.normal(0.0, angle if turns else length))
    for x in "xyz":
        errors[f"map_{x}"] = float(rng.normal(0.0, tool))
        errors[f"fixture_A_{x}"] = float(rng.normal(0.0, place))
    errors["zero"] = float(rng.normal(0.0, 3e-4))
    return MappingProxyType(errors)


def draw_truth(arm, seed, effects=(), noise=Noise(), mass_spread=0.0):
    """Random geometry with given effects and noise; link masses off by ``mass_spread`` of themselves (1 sigma)."""
    rng = np.random.default_rng([seed, 1])
    errors = draw_errors(arm, rng)
    factor = np.exp(mass_spread * rng.standard_normal(arm.n_joints))
    return Truth(seed, errors, tuple(effects), noise, tuple(float(f) for f in factor))
