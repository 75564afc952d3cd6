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
class Hysteresis:
    """φ = −½ … ½: friction on a spring goes from one side to the other over ``width`` [rad] of travel.

    The play operator (Visintin 1994, Differential Models of Hysteresis, ch. III), run from each sample's last few
    reversals (n, N, M) [rad], the latest last, to where the joint stands.
    """

    joint: int
    width: float

    @property
    def key(self) -> str:
        """``hysteresis:3:0.1``."""
        return f"hysteresis:{self.joint + 1}:{self.width!r}"

    def __call__(self, c: Context) -> Array:
        """Return the state of the spring."""
        turned = np.asarray(getattr(c.samples, "reversals", None))[:, self.joint]
        way = np.diff(np.column_stack([turned, c.samples.q[:, self.joint]]), axis=1)
        state = np.zeros(len(way))
        for step in way.T:
            state = np.clip(state + step / self.width, -0.5, 0.5)
        return state


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
