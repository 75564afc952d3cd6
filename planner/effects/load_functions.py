"""Basis functions of loads: what yields under weight, payload, the bar's pull and the drives."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.effects.basis import Phi
from planner.effects.context import Context


@dataclass(frozen=True)
class LoadMoment:
    """φ = moment [Nm] of weights and the bar's pull about an axis (0, 1, 2) of a station, see ``Context``."""

    station: int
    axis: int

    @property
    def key(self) -> str:
        """``moment:0:0`` for the base about x."""
        return f"moment:{self.station}:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return the moment."""
        return np.asarray(c.moments[self.station, self.axis])


@dataclass(frozen=True)
class TipMoment:
    """φ = moment [Nm/kg] about an axis of the flange of a unit mass in the measured point: a tool of unknown weight."""

    axis: int

    @property
    def key(self) -> str:
        """``tip:0`` about x."""
        return f"tip:{self.axis}"

    def __call__(self, c: Context) -> Array:
        """Return the moment."""
        moment = np.cross(c.motion.x - c.stations.p[-1], c.setup.gravity_B[:, None], axis=0)
        return np.asarray(np.einsum("in,in->n", c.stations.R[-1][:, self.axis], moment))


@dataclass(frozen=True)
class StationTwist:
    """φ = one of the six numbers by which a turn about an axis of a station moves the whole arm as seen at its base.

    Part 0, 1, 2 go with the base's shifts, 3, 4, 5 with its turns; all six together, times ``by``, turn everything
    beyond the station about its axis (a screw in Plücker coordinates: u and p × u).
    """

    station: int
    axis: int
    part: int
    by: Phi

    @property
    def key(self) -> str:
        """``twist:2:0:0:moment:2:0``."""
        return f"twist:{self.station}:{self.axis}:{self.part}:{self.by.key}"

    def __call__(self, c: Context) -> Array:
        """Return the number."""
        u = c.stations.R[self.station, :, self.axis]
        if self.part >= 3:
            return np.asarray(u[self.part - 3] * self.by(c))
        p, k, m = c.stations.p[self.station], (self.part + 1) % 3, (self.part + 2) % 3
        return np.asarray((p[k] * u[m] - p[m] * u[k]) * self.by(c))


@dataclass(frozen=True)
class WeightTorque:
    """φ = torque [Nm/kg] about a joint of a unit mass in the centre of a link or (link = N) of the payload."""

    joint: int
    link: int

    @property
    def key(self) -> str:
        """``weight:2:3`` for joint 2 and link 3."""
        return f"weight:{self.joint + 1}:{self.link + 1}"

    def __call__(self, c: Context) -> Array:
        """Return the torque."""
        k = c.joints[self.joint]
        lever = c.centres[self.link] - c.motion.p[k]
        return np.asarray(np.einsum("in,in->n", c.motion.u[k], np.cross(lever, c.setup.gravity_B[:, None], axis=0)))


@dataclass(frozen=True)
class PayloadTorque:
    """φ = torque [Nm] of the logged payload alone about a joint."""

    joint: int

    @property
    def key(self) -> str:
        """``payload:2`` for joint 2."""
        return f"payload:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return the torque."""
        assert c.samples.payload is not None
        return c.samples.payload * WeightTorque(self.joint, c.setup.robot.n_joints)(c)


@dataclass(frozen=True)
class DriveTorque:
    """φ = torque [Nm] against which a joint's drive holds, as logged, in the sense of the kinematic row."""

    joint: int

    @property
    def key(self) -> str:
        """``drive:2`` for joint 2."""
        return f"drive:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return minus the logged torque."""
        assert c.samples.torque is not None
        return np.asarray(
            -c.samples.torque[:, self.joint] * np.sign(c.setup.robot.sense_matrix[self.joint, self.joint])
        )


@dataclass(frozen=True)
class TorqueSign:
    """φ = ±½ by the sign of the load torque about a joint: the side on which the teeth lie."""

    joint: int

    @property
    def key(self) -> str:
        """``torque-sign:2`` for joint 2."""
        return f"torque-sign:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return half the sign."""
        return np.asarray(0.5 * np.sign(c.load_torque[:, self.joint]))
