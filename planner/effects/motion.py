"""Basis functions of how a joint came to where it stands: play, lag, angles read before they settled."""

from dataclasses import dataclass

import numpy as np

from planner.effects.context import Context
from planner.units import Array


@dataclass(frozen=True)
class SpeedSign:
    """φ = ±½ by the sign of a joint's speed."""

    joint: int

    @property
    def key(self) -> str:
        """``speed-sign:3`` for joint 3."""
        return f"speed-sign:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return half the sign."""
        assert c.samples.speed is not None
        return np.asarray(0.5 * np.sign(c.samples.speed[:, self.joint]))


@dataclass(frozen=True)
class Approach:
    """φ = ±½ by the side from which a joint was last approached."""

    joint: int

    @property
    def key(self) -> str:
        """``approach:3`` for joint 3."""
        return f"approach:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return half the direction."""
        assert c.samples.direction is not None
        return np.asarray(0.5 * c.samples.direction[:, self.joint])


@dataclass(frozen=True)
class Behind:
    """φ = −speed [rad/s] of a joint: the arm stands where it was read a lag ago, sense of the kinematic row."""

    joint: int

    @property
    def key(self) -> str:
        """``behind:3`` for joint 3."""
        return f"behind:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return minus the speed."""
        assert c.samples.speed is not None
        return np.asarray(-c.samples.speed @ c.rig.robot.sense_matrix[self.joint])


@dataclass(frozen=True)
class Unsettled:
    """φ = commanded − read angle [rad] of a joint, sense of the kinematic row."""

    joint: int

    @property
    def key(self) -> str:
        """``unsettled:3`` for joint 3."""
        return f"unsettled:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        assert c.samples.q_cmd is not None
        assert c.samples.q_read is not None
        return np.asarray((c.samples.q_cmd - c.samples.q_read) @ c.rig.robot.sense_matrix[self.joint])
