"""Corrected joint angles: the calibrated flange is brought to where the nominal one was asked to be."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.determinism import Positions
from planner.common.units import Array, read_only
from planner.compensation.few_axes import FULL_AXES, ToolDeviation, ToolGoal, TurnWeights, solve_few_axes
from planner.compensation.tolerances import (
    COARSE_ARM_SIGMAS,
    JACOBIAN_STEP,
    LARGEST_STEP,
    LOST_DIRECTION_SHARE,
    SINGULAR_SHARE,
    SOLVED,
)
from planner.kinematics.inverse_kinematics import (
    rotation_between,
    shorten,
    smallest_singular_value,
    solve_ik,
    tool_pose,
)
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


ALL_TURNS = TurnWeights()


@dataclass(frozen=True)
class Correction:
    """Corrected joint angles of n targets, and how well they do.

    Attributes:
        q: corrected controller angles, (n, N) [rad]; where ``solved`` is false the best that was found.
        before, after: how far the calibrated tool is from the wanted one, uncorrected and corrected.
        moved: how far each joint was moved, (n, N) [rad].
        solved: whether the target was met, (n,) bool; of arms with fewer than six axes: came nearer.
        within: whether the angles are inside the joint limits, (n,) bool.
        near: whether no joint moved further than :func:`move_limit`, (n,) bool.
        singular: whether the arm is near a singular position there, (n,) bool.
    """

    q: Array
    before: ToolDeviation
    after: ToolDeviation
    moved: Array
    solved: np.ndarray
    within: np.ndarray
    near: np.ndarray
    singular: np.ndarray

    @property
    def residual_rad(self) -> Array:
        """Angle that is left between the tools, (n,) [rad]."""
        return np.hypot(self.after.tilt, self.after.spin)

    @property
    def usable(self) -> np.ndarray:
        """Whether the target can be used: met, within the limits, and near the nominal one, (n,) bool."""
        return np.asarray(self.solved & self.within & self.near)


def correct_joints(
    robot: Robot,
    nominal: FlangeModel,
    calibrated: FlangeModel,
    q: Array,
    T_FT: Array | None = None,
    weights: TurnWeights = ALL_TURNS,
) -> Correction:
    """Return the joint angles that bring the calibrated flange to where the nominal one is at ``q``.

    Robots with more than six joints make the least-norm step. With fewer than six the tool point is brought to its
    place, and the tool is turned as nearly as the arm can (:mod:`planner.compensation.few_axes`).

    Args:
        robot: the nominal robot: screws, and the limits that the result is checked against.
        nominal: the robot that the controller believes in.
        calibrated: the robot as it is; its flange may depend on q in any smooth way (compliance, gear errors).
        q: controller angles of the targets, (n, N) [rad].
        T_FT: tools in the flange, (n, 4, 4) [m], which count with fewer than six axes; without them the flange.
        weights: of tilt and spin, with fewer than six axes.
    """
    goal = ToolGoal.of(nominal, q, np.broadcast_to(np.eye(4), (len(q), 4, 4)) if T_FT is None else T_FT)
    before = ToolDeviation.at(goal, calibrated, q)
    if robot.n_joints < FULL_AXES:
        q_new = solve_few_axes(robot, calibrated, q, goal, weights, move_limit(robot))
        after = ToolDeviation.at(goal, calibrated, q_new)
        solved = (after.distance < 10 * SOLVED) | (after.distance < before.distance)
    else:
        p, R = nominal.flange(q)
        q_new = solve_flange_ik(robot, calibrated, q, p, R)
        after = ToolDeviation.at(goal, calibrated, q_new)
        far_m, far_rad = flange_deviation(calibrated, q_new, p, R)
        solved = (far_m < 10 * SOLVED) & (far_rad < 10 * SOLVED)
    moved = q_new - q
    slack = 1e-9  # [rad] a nominal target may stand on its limit
    within = ((q_new >= robot.q_lower - slack) & (q_new <= robot.q_upper + slack)).all(axis=1)
    return Correction(
        q=read_only(q_new),
        before=before,
        after=after,
        moved=read_only(moved),
        solved=np.asarray(solved),
        within=np.asarray(within),
        near=np.asarray((np.abs(moved) <= move_limit(robot)).all(axis=1)),
        singular=near_singular(robot, q),
    )


def move_limit(robot: Robot) -> float:
    """Return how far a correction may move a joint [rad]: over ten degrees where its parts are coarse."""
    # 10.0: [deg] a calibration that moves a joint by more is no small correction
    return max(float(np.deg2rad(10.0)), COARSE_ARM_SIGMAS * robot.priors.angle)


def near_singular(robot: Robot, q: Array) -> np.ndarray:
    """Return whether the arm at q (n, N) [rad] is near a singular position, (n,) bool.

    The smallest singular value of its Jacobian is compared with the median over its joint limits, so that the size of
    the arm does not count. An arm of five axes has lost nothing by having five.
    """
    lower, upper = robot.one_turn
    states = np.random.default_rng(0).uniform(lower, upper, (200, robot.n_joints))  # random states tell what is usual
    usual = np.median(smallest_singular_value(robot.chain, robot, states))
    return np.asarray(smallest_singular_value(robot.chain, robot, q) < SINGULAR_SHARE * usual)


def flange_deviation(poser: FlangeModel, q: Array, p: Array, R: Array) -> tuple[Array, Array]:
    """Return how far ``poser`` at q (n, N) [rad] is from p (n, 3), R (n, 3, 3): (n,) [m] and (n,) [rad]."""
    e = _error(poser, q, p, R)
    return np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1)


def solve_flange_ik(
    robot: Robot, poser: FlangeModel, start: Array, p: Array, R: Array, rounds: tuple[int, int] = (12, 20)
) -> Array:
    """Return angles (n, N) [rad] at which ``poser`` stands at p (n, 3) [m], R (n, 3, 3), for six joints or more.

    All targets step together; those that have arrived rest. A target that cannot be met ends at the best angles seen.
    ``rounds``: with the nominal Jacobian, and then with the own one.
    """

    def task(q: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the error to the wanted flange pose at q (m, N), and its Jacobian."""
        return _error(poser, q, p[rows], R[rows]), tool_pose(robot.chain, robot, q)[2]

    found = solve_ik(task, start, step=_step, iterations=rounds[0], tolerance=SOLVED)
    far = np.flatnonzero(found.error > SOLVED)
    if not len(far) or not rounds[1]:
        return found.best

    def tool_frame_error(q: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the error and its Jacobian in the flange's own axes."""
        return _error(poser, q, p[far[rows]], R[far[rows]]), _own_jacobian(poser, q)

    again = solve_ik(tool_frame_error, found.best[far], step=_step, iterations=rounds[1], tolerance=SOLVED)
    q = found.best.copy()
    q[far] = again.best
    return q


def _error(poser: FlangeModel, q: Array, p: Array, R: Array) -> Array:
    """Return the remaining error, (n, 6) [m, rad] in the base frame."""
    x, R_now = poser.flange(q)
    return np.concatenate([p - x, rotation_between(R_now, R)], axis=1)


def _step(J: Array, missing: Array) -> Array:
    step = np.einsum("nij,nj->ni", np.linalg.pinv(J, rcond=LOST_DIRECTION_SHARE), missing)
    return shorten(step, np.abs(step).max(axis=1), LARGEST_STEP)


def _own_jacobian(poser: FlangeModel, q: Array) -> Array:
    """Return the numeric Jacobian (n, 6, N) of any robot, by central differences, in one batch."""
    n, N = q.shape
    shift = JACOBIAN_STEP * np.eye(N)
    both = (q[:, None, None, :] + np.stack([shift, -shift])[None]).reshape(-1, N)
    x, R = poser.flange(both)
    x, R = x.reshape(n, 2, N, 3), R.reshape(n, 2, N, 3, 3)
    turn = rotation_between(R[:, 1].reshape(-1, 3, 3), R[:, 0].reshape(-1, 3, 3)).reshape(n, N, 3)
    return np.swapaxes(np.concatenate([x[:, 0] - x[:, 1], turn], axis=2), 1, 2) / (2 * JACOBIAN_STEP)
