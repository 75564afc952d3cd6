"""Robots with errors: ours through the chain, and the same once more by multiplying matrices, or pinocchio's."""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

import tests.programs.sessions as sessions
from planner.kinematics.chain import Chain
from planner.kinematics.robot import Robot, elementary_placement
from planner.kinematics.robot_reader import load_robot
from planner.programs.dialect import load_dialect
from tests.not_everywhere import pin


@dataclass(frozen=True)
class BentRobot:
    """Geometric errors, and joints 2 and 3 that give way under a weight whose lever depends on the pose."""

    robot: Robot
    delta: np.ndarray
    give: float = 0.0

    def values(self, q):
        delta = [np.full(len(q), d) for d in self.delta]
        for k, t in enumerate(self.robot.transforms):
            if t.joint in (1, 2):
                delta[k] = delta[k] + self.give * np.cos(q[:, 1] + 0.5 * q[:, 2])
        return delta

    def flange(self, q):
        motion = Chain(self.robot.transforms).forward(self.robot.theta(q), self.values(q))
        return motion.x.T, np.moveaxis(motion.R, 2, 0)


def bent(name, seed=0, size=5e-4, give=1e-3):
    robot = load_robot(name)
    delta = np.random.default_rng(seed).normal(0.0, size, len(robot.transforms))
    return robot, BentRobot(robot, delta, give)


def exact(robot):
    return BentRobot(robot, np.zeros(len(robot.transforms)))


def flange_pose(bent_robot, q):
    """Pose (4, 4) of the flange at one posture (n,), by multiplying the placements."""
    return reduce(np.matmul, _placements(bent_robot, q))


def pin_flange(bent_robot, q):
    """The same by pinocchio."""
    T = pin.SE3.Identity()
    for placement in _placements(bent_robot, q):
        T = T * pin.SE3(placement)
    return T.homogeneous


def _placements(bent_robot, q):
    robot = bent_robot.robot
    theta, delta = robot.theta(q[None])[0], bent_robot.values(q[None])
    return [
        elementary_placement(t, t.nominal + d[0] + (0.0 if t.joint is None else theta[t.joint]))
        for t, d in zip(robot.transforms, delta, strict=True)
    ]


def regular_angles(robot, n, seed=0, margin=0.05):
    """Random angles away from limits and from singular positions of arm and wrist (six joints)."""
    rng = np.random.default_rng(seed)
    low, up = np.maximum(robot.q_lower, -np.pi) + margin, np.minimum(robot.q_upper, np.pi) - margin
    kept = []
    while len(kept) < n:
        q = rng.uniform(low, up)
        if np.linalg.cond(_screws(robot, q)) < 40.0:
            kept.append(q)
    return np.array(kept)


def _screws(robot, q):
    """Motion (6, n) of the flange's frame, as seen at the base, by each joint alone."""
    T, screws = np.eye(4), []
    for t, placement in zip(robot.transforms, _placements(exact(robot), q), strict=True):
        if t.joint is not None:
            along = T[:3, t.axis]
            turns = t.kind == "rotation"
            screws.append(np.append(np.cross(T[:3, 3], along), along) if turns else np.append(along, np.zeros(3)))
        T = T @ placement
    return np.transpose(screws)


def unlimited(robot):
    return replace(robot, q_lower=np.full(robot.n_joints, -7.0), q_upper=np.full(robot.n_joints, 7.0))


def half_pulse_deg(name, pulses_per_deg=sessions.PULSES[:6]):
    """By how much rounding to pulses moves each axis [deg]; none in a dialect that writes degrees."""
    dialect = load_dialect(name)
    return dialect.resolution_deg(pulses_per_deg) if dialect.pulses else np.zeros(6)
