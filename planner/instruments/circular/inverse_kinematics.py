"""Joint angles that hold a tool pose, by damped Newton steps on the chain's own screws, many at once."""

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.common.units import Array

LENGTH_SCALE = 0.5  # [m] length that makes a turn and a travel comparable
STRIDE = 0.5  # [rad] longest step of the joints together
DAMPING = 1e-3  # times the squared error: far away the step is cautious, near the end it is Newton's
POSE_TOLERANCE = 1e-9  # [m / ARM and rad] error of a pose that is held


def tool_frames(cell: Cell, q: Array) -> tuple[Array, Array, Array]:
    """Return the tool at controller angles q (n, N) [rad].

    Returns:
        The measured point p_BM (n, 3) [m], the flange's orientation R_BF (n, 3, 3), and the Jacobian (n, 6, N) of
        both by the controller angles [m/rad and rad/rad].
    """
    chain, robot = cell.chain, cell.robot
    motion = chain.forward(robot.theta(q))
    place = {t.joint: k for k, t in enumerate(chain.transforms) if t.joint is not None}
    moving = np.array([place[j] for j in range(robot.n_joints)])
    screws = np.concatenate([motion.point_screws(moving), motion.u[moving]], axis=1)  # (N, 6, n) by theta
    J = np.einsum("jkn,ji->nki", screws, robot.sense_matrix)
    return motion.x.T, np.moveaxis(motion.R, 2, 0), J


def solve_ik(cell: Cell, q: Array, x: Array, R: Array, rounds: int) -> tuple[Array, np.ndarray]:
    """Find joint angles that hold tool poses, from the nearest configuration to where they start.

    Args:
        cell: robot and tool.
        q: where to start (n, N) [rad].
        x: wanted p_BM (n, 3) [m].
        R: wanted R_BF (n, 3, 3).
        rounds: steps at most.

    Returns:
        The angles (n, N) [rad], limits not looked at, and which of them hold their pose, (n,) bool.
    """
    q, good = q.copy(), np.zeros(len(q), dtype=bool)
    rows = np.arange(len(q))
    for _ in range(rounds + 1):
        point, turn, J = tool_frames(cell, q[rows])
        twist = Rotation.from_matrix(R[rows] @ np.swapaxes(turn, 1, 2)).as_rotvec()
        error = np.hstack([(x[rows] - point) / LENGTH_SCALE, twist])
        far = np.abs(error).max(axis=1)
        good[rows] = far < POSE_TOLERANCE
        J, error, rows = J[far >= POSE_TOLERANCE], error[far >= POSE_TOLERANCE], rows[far >= POSE_TOLERANCE]
        if not len(rows):
            break
        q[rows] += _step(J, error)
    return q, good


def conditioning(cell: Cell, q: Array) -> Array:
    """Smallest singular value of the tool's Jacobian, lengths in units of ARM, (n,): 0 where the arm is singular."""
    _, _, J = tool_frames(cell, q)
    J[:, :3] /= LENGTH_SCALE
    return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1])


def _step(J: Array, error: Array) -> Array:
    scaled = J.copy()
    scaled[:, :3] /= LENGTH_SCALE
    damping = DAMPING * np.einsum("ni,ni->n", error, error) + 1e-12
    normal = scaled @ np.swapaxes(scaled, 1, 2) + damping[:, None, None] * np.eye(6)
    step = np.einsum("nji,nj->ni", scaled, np.linalg.solve(normal, error[:, :, None])[:, :, 0])
    size = np.linalg.norm(step, axis=1)
    return np.asarray(step * np.minimum(1.0, STRIDE / np.maximum(size, 1e-12))[:, None])
