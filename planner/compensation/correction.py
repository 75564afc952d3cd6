"""Corrected joint angles: the calibrated flange is brought to where the nominal one was asked to be."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.determinism import Positions
from planner.common.units import Array, read_only
from planner.kinematics.inverse_kinematics import rotation_between, shorten, solve_ik, tool_pose
from planner.kinematics.robot import Robot


class FlangeModel(Protocol):
    """A robot, as far as compensation needs it."""

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad], all effects included."""


@dataclass(frozen=True)
class NominalFlange:
    """The rigid robot that the controller believes in."""

    robot: Robot

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad]."""
        return tool_pose(self.robot.chain, self.robot, q)[:2]


TOLERANCE = 1e-9  # [m and rad] of a solved target
STEP_LIMIT = 0.1  # [rad] of any joint in one iteration
MOVE_LIMIT = np.deg2rad(10.0)  # a calibration that moves a joint by more is no small correction
ROUNDS = (12, 20)  # iterations with the nominal Jacobian, and then with the own one
DIFFERENCE = 1e-6  # [rad] of the numeric Jacobian
PIVOT = 1e-7  # singular values below this part of the largest are directions that the arm has lost


@dataclass(frozen=True)
class Correction:
    """Corrected joint angles of n targets, and how well they do.

    Attributes:
        q: corrected controller angles, (n, N) [rad]; where ``solved`` is false the best that was found.
        residual_m: distance of the calibrated flange from the wanted one, (n,) [m].
        residual_rad: angle between the two, (n,) [rad]; of the flange's z axis alone on robots of five joints.
        moved: how far each joint was moved, (n, N) [rad].
        solved: whether the target was met, (n,) bool.
        within: whether the angles are inside the joint limits, (n,) bool.
        near: whether no joint moved further than ``MOVE_LIMIT``, (n,) bool.
    """

    q: Array
    residual_m: Array
    residual_rad: Array
    moved: Array
    solved: np.ndarray
    within: np.ndarray
    near: np.ndarray

    @property
    def good(self) -> np.ndarray:
        """Whether the target can be used: met, within the limits, and near the nominal one, (n,) bool."""
        return np.asarray(self.solved & self.within & self.near)


def correct_joints(robot: Robot, nominal: FlangeModel, calibrated: FlangeModel, q: Array) -> Correction:
    """Return the joint angles that bring the calibrated flange to where the nominal one is at ``q``.

    Args:
        robot: the nominal robot: screws, and the limits that the result is checked against.
        nominal: the robot that the controller believes in.
        calibrated: the robot as it is; its flange may depend on q in any smooth way (compliance, gear errors).
        q: controller angles of the targets, (n, N) [rad].

    Robots with more than six joints make the least-norm step; with five, position and the flange's z axis are kept.
    """
    p, R = nominal.flange(q)
    q_new = solve_flange_ik(robot, calibrated, q, p, R)
    far_m, far_rad = flange_deviation(robot, calibrated, q_new, p, R)
    moved = q_new - q
    slack = 1e-9  # [rad] a nominal target may stand on its limit
    within = ((q_new >= robot.q_lower - slack) & (q_new <= robot.q_upper + slack)).all(axis=1)
    return Correction(
        q=read_only(q_new),
        residual_m=read_only(far_m),
        residual_rad=read_only(far_rad),
        moved=read_only(moved),
        solved=(far_m < 10 * TOLERANCE) & (far_rad < 10 * TOLERANCE),
        within=np.asarray(within),
        near=(np.abs(moved) <= MOVE_LIMIT).all(axis=1),
    )


def flange_deviation(robot: Robot, poser: FlangeModel, q: Array, p: Array, R: Array) -> tuple[Array, Array]:
    """Return how far ``poser`` at q (n, N) [rad] is from p (n, 3), R (n, 3, 3): (n,) [m] and (n,) [rad]."""
    e = _error(robot, poser, q, p, R)
    return np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1)


def solve_flange_ik(
    robot: Robot, poser: FlangeModel, start: Array, p: Array, R: Array, rounds: tuple[int, int] = ROUNDS
) -> Array:
    """Return angles (n, N) [rad] at which ``poser`` stands at p (n, 3) [m], R (n, 3, 3).

    All targets step together; those that have arrived rest. A target that cannot be met ends at the best angles seen.
    """

    def task(q: Array, rows: Positions) -> tuple[Array, Array]:
        J = tool_pose(robot.chain, robot, q)[2]
        return _error(robot, poser, q, p[rows], R[rows]), _across_spin(robot, J, R[rows])

    found = solve_ik(task, start, step=_step, iterations=rounds[0], tolerance=TOLERANCE)
    far = np.flatnonzero(found.error > TOLERANCE)
    if not len(far) or not rounds[1]:
        return found.best

    def own_task(q: Array, rows: Positions) -> tuple[Array, Array]:
        wanted = p[far[rows]], R[far[rows]]
        return _error(robot, poser, q, *wanted), _across_spin(robot, _own_jacobian(poser, q), wanted[1])

    again = solve_ik(own_task, found.best[far], step=_step, iterations=rounds[1], tolerance=TOLERANCE)
    q = found.best.copy()
    q[far] = again.best
    return q


def _error(robot: Robot, poser: FlangeModel, q: Array, p: Array, R: Array) -> Array:
    """Return what is missing, (n, 6) [m, rad] in the base frame; five joints leave the turn about the flange's z."""
    x, R_now = poser.flange(q)
    turn = rotation_between(R_now, R)
    if robot.n_joints == 5:
        turn = _across(turn, R[:, :, 2])
    return np.concatenate([p - x, turn], axis=1)


def _across_spin(robot: Robot, J: Array, R: Array) -> Array:
    """Return the Jacobian (n, 6, N) of what is missing: five joints leave the turn about the flange's z."""
    if robot.n_joints != 5:
        return J
    return np.concatenate([J[:, :3], np.swapaxes(_across(np.swapaxes(J[:, 3:], 1, 2), R[:, None, :, 2]), 1, 2)], axis=1)


def _step(J: Array, missing: Array) -> Array:
    step = np.einsum("nij,nj->ni", np.linalg.pinv(J, rcond=PIVOT), missing)
    return shorten(step, np.abs(step).max(axis=1), STEP_LIMIT)


def _across(v: Array, axis: Array) -> Array:
    return np.asarray(v - axis * np.einsum("...j,...j->...", v, axis)[..., None])


def _own_jacobian(poser: FlangeModel, q: Array) -> Array:
    """Return the numeric Jacobian (n, 6, N) of any robot, by central differences, in one batch."""
    n, N = q.shape
    shift = DIFFERENCE * np.eye(N)
    both = (q[:, None, None, :] + np.stack([shift, -shift])[None]).reshape(-1, N)
    x, R = poser.flange(both)
    x, R = x.reshape(n, 2, N, 3), R.reshape(n, 2, N, 3, 3)
    turn = rotation_between(R[:, 1].reshape(-1, 3, 3), R[:, 0].reshape(-1, 3, 3)).reshape(n, N, 3)
    return np.swapaxes(np.concatenate([x[:, 0] - x[:, 1], turn], axis=2), 1, 2) / (2 * DIFFERENCE)
