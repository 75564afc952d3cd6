"""Corrected joint angles: the calibrated flange is brought to where the nominal one was asked to be."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.units import Array, read_only
from planner.compensation.rotations import turn_between
from planner.kinematics.robot import Robot


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
        iterations: of the slowest target.
        solved: whether the target was met, (n,) bool.
        within: whether the angles are inside the joint limits, (n,) bool.
        near: whether no joint moved further than ``MOVE_LIMIT``, (n,) bool.
    """

    q: Array
    residual_m: Array
    residual_rad: Array
    moved: Array
    iterations: int
    solved: np.ndarray
    within: np.ndarray
    near: np.ndarray

    @property
    def good(self) -> np.ndarray:
        """Whether the target can be used: met, within the limits, and near the nominal one, (n,) bool."""
        return np.asarray(self.solved & self.within & self.near)


def correct_joints(robot: Robot, nominal: Poser, calibrated: Poser, q: Array) -> Correction:
    """Return the joint angles that bring the calibrated flange to where the nominal one is at ``q``.

    Args:
        robot: the nominal robot: screws, and the limits that the result is checked against.
        nominal: the robot that the controller believes in.
        calibrated: the robot as it is; its flange may depend on q in any smooth way (compliance, gear errors).
        q: controller angles of the targets, (n, N) [rad].

    Robots with seven joints make the least-norm step; with five, position and the flange's z axis are kept.
    """
    p, R = nominal.flange(q)
    q_new, iterations = solve_flange_ik(robot, calibrated, q, p, R)
    far_m, far_rad = flange_deviation(robot, calibrated, q_new, p, R)
    moved = q_new - q
    slack = 1e-9  # [rad] a nominal target may stand on its limit
    within = ((q_new >= robot.q_lower - slack) & (q_new <= robot.q_upper + slack)).all(axis=1)
    return Correction(
        q=read_only(q_new),
        residual_m=read_only(far_m),
        residual_rad=read_only(far_rad),
        moved=read_only(moved),
        iterations=iterations,
        solved=(far_m < 10 * TOLERANCE) & (far_rad < 10 * TOLERANCE),
        within=np.asarray(within),
        near=(np.abs(moved) <= MOVE_LIMIT).all(axis=1),
    )


def flange_deviation(robot: Robot, poser: Poser, q: Array, p: Array, R: Array) -> tuple[Array, Array]:
    """Return how far ``poser`` at q (n, N) [rad] is from p (n, 3), R (n, 3, 3): (n,) [m] and (n,) [rad]."""
    e = _error(robot, poser, q, p, R)
    return np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1)


def solve_flange_ik(
    robot: Robot, poser: Poser, start: Array, p: Array, R: Array, rounds: tuple[int, int] = ROUNDS
) -> tuple[Array, int]:
    """Return angles (n, N) [rad] at which ``poser`` stands at p (n, 3) [m], R (n, 3, 3), and the iterations made.

    All targets step together; those that have arrived rest. A target that cannot be met ends at the best angles seen.
    """
    q, best = start.copy(), np.full(len(start), np.inf)
    q_best = start.copy()
    first, last = rounds[0], sum(rounds)
    for count in range(last + 1):
        e = _error(robot, poser, q, p, R)
        size = np.abs(e).max(axis=1, initial=0.0)
        better = size < best
        best, q_best = np.where(better, size, best), np.where(better[:, None], q, q_best)
        far = np.flatnonzero(best > TOLERANCE)
        if not far.size or count == last:
            return q_best, count
        if count < first:
            J = flange_jacobian(robot, q[far])
        else:
            q[far] = q_best[far] if count == first else q[far]
            e[far] = _error(robot, poser, q[far], p[far], R[far])
            J = _own_jacobian(poser, q[far])
        q[far] += _step(robot, J, e[far], R[far])
    raise AssertionError("the loop above returns")


def _error(robot: Robot, poser: Poser, q: Array, p: Array, R: Array) -> Array:
    """Return what is missing, (n, 6) [m, rad] in the base frame; five joints leave the turn about the flange's z."""
    x, R_now = poser.flange(q)
    turn = turn_between(R_now, R)
    if robot.n_joints == 5:
        turn = _across(turn, R[:, :, 2])
    return np.concatenate([p - x, turn], axis=1)


def _step(robot: Robot, J: Array, e: Array, R: Array) -> Array:
    if robot.n_joints == 5:
        J = J.copy()
        J[:, 3:] = J[:, 3:] - R[:, :, 2, None] * np.einsum("ni,nij->nj", R[:, :, 2], J[:, 3:])[:, None, :]
    dq = np.einsum("nij,nj->ni", np.linalg.pinv(J, rcond=PIVOT), e)
    longest = np.abs(dq).max(axis=1, keepdims=True)
    return np.asarray(dq * np.minimum(1.0, STEP_LIMIT / np.maximum(longest, STEP_LIMIT)))


def _across(v: Array, axis: Array) -> Array:
    return np.asarray(v - axis * np.einsum("ij,ij->i", v, axis)[:, None])


def _own_jacobian(poser: Poser, q: Array) -> Array:
    """Return the numeric Jacobian (n, 6, N) of any robot, by central differences, in one batch."""
    n, N = q.shape
    shift = DIFFERENCE * np.eye(N)
    both = (q[:, None, None, :] + np.stack([shift, -shift])[None]).reshape(-1, N)
    x, R = poser.flange(both)
    x, R = x.reshape(n, 2, N, 3), R.reshape(n, 2, N, 3, 3)
    turn = turn_between(R[:, 1].reshape(-1, 3, 3), R[:, 0].reshape(-1, 3, 3)).reshape(n, N, 3)
    return np.swapaxes(np.concatenate([x[:, 0] - x[:, 1], turn], axis=2), 1, 2) / (2 * DIFFERENCE)
