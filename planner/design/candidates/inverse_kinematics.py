"""Joint angles that put the measured point on a given point: Newton on the chain's own screws, many states at a time.

The last joints are given and the first three are solved for, so that every orientation and every posture of the arm
that reaches the point comes up as often as the samples and starts do; no wrist or elbow of a certain build is assumed.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.kinematics.chain import Chain

ITERATIONS = 14
LONGEST = 0.6  # [rad] any joint moves in one step
DAMPING = 1e-4  # of the mean square of a column, far from the point
ON = 1e-9  # [m] by which a solution may miss the point
TURN = 2 * np.pi


@dataclass(frozen=True)
class PointIkResult:
    """Where the search ended: controller angles q (n, N) [rad] and the distance from the point ``off`` (n,) [m]."""

    q: Array
    off: Array


class PointIk:
    """Solves for the first three joints of a cell's arm."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        transforms = cell.chain.transforms
        end = next(k for k, t in enumerate(transforms) if t.joint == 3)
        self._front, self._rest = Chain(transforms[:end]), Chain(transforms[end:])

    @cached_property
    def _moving(self) -> np.ndarray:
        place = {t.joint: k for k, t in enumerate(self._front.transforms) if t.joint is not None}
        return np.array([place[j] for j in range(3)])

    def position(self, q: Array, p_B: Array) -> PointIkResult:
        """Move the first three joints of q (n, N) [rad] until the measured point lies on p_B (3,) [m], or nearest."""
        theta = self.cell.robot.theta(q)
        w = self._rest.carry(theta, np.zeros(3))
        off = np.full(len(q), np.inf)
        open_ = np.arange(len(q))
        for _ in range(ITERATIONS):
            error, J = self._error(theta[open_], w[open_], p_B)
            off[open_] = np.linalg.norm(error, axis=1)
            far = off[open_] > ON
            open_, error, J = open_[far], error[far], J[far]
            if not len(open_):
                break
            theta[open_, :3] += _newton_step(J, error)
        if len(open_):
            off[open_] = np.linalg.norm(self._error(theta[open_], w[open_], p_B)[0], axis=1)
        return PointIkResult(self._within(theta), off)

    def _error(self, theta: Array, w: Array, p_B: Array) -> tuple[Array, Array]:
        """What is missing to the point, (n, 3) [m], and the point's velocity per joint, (n, 3, 3) [m/rad]."""
        motion = self._front.forward(theta)
        x = motion.x + np.einsum("ijn,nj->in", motion.R, w)
        J = np.cross(motion.u[self._moving], x - motion.p[self._moving], axis=1)  # (3 joints, 3, n)
        return p_B - x.T, np.moveaxis(J, (0, 1, 2), (2, 1, 0))

    def _within(self, theta: Array) -> Array:
        """Controller angles with whole turns taken off where that brings a joint between its limits."""
        robot = self.cell.robot
        q = np.linalg.solve(robot.sense_matrix, (theta - robot.theta_zero).T).T
        return np.asarray(q - TURN * np.round((q - (robot.q_lower + robot.q_upper) / 2) / TURN))


def retract_tool(cell: Cell, q: Array, way: float) -> PointIkResult:
    """Return the poses from which the tool comes along its own axis: ``way`` [m] back, its orientation kept.

    Newton with all joints on position and orientation, from q (n, N) [rad].
    """
    chain = cell.chain
    moving = np.array([next(k for k, t in enumerate(chain.transforms) if t.joint == j) for j in range(q.shape[1])])
    start = chain.forward(cell.robot.theta(q))
    R0, goal = np.array(start.R), start.x - way * np.einsum("ijn,j->in", start.R, cell.tool.axis_F)
    out = q.copy()
    off = np.full(len(q), np.inf)
    for _ in range(ITERATIONS):
        motion = chain.forward(cell.robot.theta(out))
        turn = sum(np.cross(motion.R[:, k].T, R0[:, k].T) for k in range(3)) / 2
        error = np.concatenate([(goal - motion.x).T, turn], axis=1)
        off = np.linalg.norm(error[:, :3], axis=1) + way * np.linalg.norm(turn, axis=1)
        if (off < ON).all():
            break
        J = np.concatenate([motion.point_screws(moving), motion.u[moving]], axis=1)  # (N, 6, n)
        out = out + _newton_step(np.einsum("jkn,ji->nki", J, cell.robot.sense_matrix), error)
    return PointIkResult(out, off)


def _newton_step(J: Array, error: Array) -> Array:
    """Damped Newton steps for J (n, m, k) and errors (n, m), (n, k) [rad]; the damping fades as the error does."""
    normal = np.swapaxes(J, 1, 2) @ J
    size = np.trace(normal, axis1=1, axis2=2) / J.shape[2]
    fade = np.minimum(1.0, (error**2).sum(axis=1) / 1e-4)
    normal += (DAMPING * fade + 1e-13)[:, None, None] * size[:, None, None] * np.eye(J.shape[2])
    step = np.linalg.solve(normal, np.swapaxes(J, 1, 2) @ error[:, :, None])[:, :, 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST / np.maximum(longest, 1e-12)))
