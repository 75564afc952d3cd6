"""Where the flange stands at given joint angles: what the nominal and the calibrated robot both answer."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.robot import Robot
from planner.units import Array


class Poser(Protocol):
    """A robot, as far as compensation needs it."""

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad], all effects included."""


@dataclass(frozen=True)
class NominalPoser:
    """The rigid robot that the controller believes in."""

    robot: Robot

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad]."""
        motion = self.robot.chain.forward(self.robot.theta(q))
        return motion.x.T, np.moveaxis(motion.R, 2, 0)


def flange_jacobian(robot: Robot, q: Array) -> Array:
    """Return the motion of the flange per controller angle, (n, 6, N): velocity [m] above angular velocity [rad].

    Both in the base frame; read off the screws of the joints' elementary transforms.
    """
    motion = robot.chain.forward(robot.theta(q))
    moving = [k for k, t in enumerate(robot.transforms) if t.joint is not None]
    joints = np.array([t.joint for t in robot.transforms if t.joint is not None])
    screws = np.concatenate([motion.point_screws()[moving], motion.u[moving]], axis=1)  # (N, 6, n)
    per_theta = np.empty((q.shape[0], 6, robot.n_joints))
    per_theta[:, :, joints] = np.moveaxis(screws, (0, 1, 2), (2, 1, 0))
    return per_theta @ robot.sense_matrix
