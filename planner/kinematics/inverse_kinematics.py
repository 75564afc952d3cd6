"""Inverse kinematics of many states at a time: Newton steps on the chain's own screws.

:func:`solve_ik` is the one solver. What it brings to zero is a task, how far it dares to go in one iteration is a step.
The functions after it are the tasks of this project: a tool pose, a point, and the pose that lies back along the tool.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.determinism import Positions
from planner.common.units import TURN, Array
from planner.kinematics.chain import Chain
from planner.kinematics.robot import Robot

LENGTH_SCALE = 0.5  # [m] length that makes a turn and a travel comparable
POINT_TOLERANCE = 1e-9  # [m] by which a solution may miss a point
RETRACT_ITERATIONS = 13  # of Newton from a pose nearby
POLISHED = 1e-12  # [m and rad] to which retracted poses are iterated

Task = Callable[[Array, Positions], tuple[Array, Array]]
"""Joint angles (n, k) of the states ``rows`` to what is missing (n, m) and the Jacobian (n, m, k) that takes it up."""

Step = Callable[[Array, Array], Array]
"""Jacobian (n, m, k) and what is missing (n, m) to changes of the joints (n, k) [rad]."""


@dataclass(frozen=True)
class IkResult:
    """Where the search of n states ended.

    Attributes:
        q: where each state came to rest, or its last step led, (n, k) [rad].
        best: where the least was missing; the same for a state that has arrived, (n, k) [rad].
        error: size of what is missing there, (n,), in the unit of the task.
    """

    q: Array
    best: Array
    error: Array


def solve_ik(task: Task, q: Array, *, step: Step, iterations: int, tolerance: float, norm: float = np.inf) -> IkResult:
    """Step all states from q (n, k) [rad] until no more than ``tolerance`` is missing; those that have arrived rest.

    ``norm``: order of the norm that measures what is missing.
    """
    q, best, error = q.copy(), q.copy(), np.full(len(q), np.inf)
    rows = np.arange(len(q))
    for count in range(iterations + 1):
        missing, J = task(q[rows], rows)
        size = np.linalg.norm(missing, ord=norm, axis=1)
        better = size < error[rows]
        error[rows[better]], best[rows[better]] = size[better], q[rows[better]]
        open_ = size > tolerance
        rows = rows[open_]
        if count == iterations or not len(rows):
            break
        q[rows] += step(J[open_], missing[open_])
    return IkResult(q, best, error)


def damped_step(J: Array, missing: Array, damping: Array) -> Array:
    """Return the damped least-squares step (n, k) with damping (n,): Jᵀ (J Jᵀ + damping)⁻¹ missing."""
    normal = J @ np.swapaxes(J, 1, 2) + damping[:, None, None] * np.eye(J.shape[1])
    return np.asarray(np.einsum("nji,nj->ni", J, np.linalg.solve(normal, missing[:, :, None])[:, :, 0]))


def shorten(step: Array, size: Array, longest: float) -> Array:
    """Shorten steps (n, k) whose size (n,) exceeds ``longest``."""
    return np.asarray(step * np.minimum(1.0, longest / np.maximum(size, 1e-12))[:, None])


def tool_pose(chain: Chain, robot: Robot, q: Array) -> tuple[Array, Array, Array]:
    """Return the end of the chain at controller angles q (n, N) [rad].

    Returns:
        Its position (n, 3) [m] and orientation (n, 3, 3) in the base frame, and the Jacobian (n, 6, N) of both by the
        controller angles [m/rad above rad/rad].
    """
    motion = chain.forward(robot.theta(q))
    moving = chain.joint_places
    screws = np.concatenate([motion.point_screws(moving), motion.turns(moving)], axis=1)  # (N, 6, n) by theta
    J = np.einsum("jkn,ji->nki", screws, robot.coupling_matrix)
    return motion.x.T, np.moveaxis(motion.R, 2, 0), J


def rotation_between(R_from: Array, R_to: Array) -> Array:
    """Return the rotation vector (n, 3) [rad], in the base frame, that turns R_from (n, 3, 3) into R_to."""
    return np.asarray(Rotation.from_matrix(R_to @ np.swapaxes(R_from, 1, 2)).as_rotvec())


def solve_pose_ik(
    chain: Chain, robot: Robot, q: Array, x: Array, R: Array, iterations: int
) -> tuple[Array, np.ndarray]:
    """Find joint angles that hold tool poses, from the nearest configuration to where they start.

    Args:
        chain: from the base to the measured point.
        robot: the robot.
        q: where to start (n, N) [rad].
        x: wanted positions (n, 3) [m].
        R: wanted orientations (n, 3, 3).
        iterations: steps at most.

    Returns:
        The angles (n, N) [rad], limits not looked at, and which of them hold their pose, (n,) bool.
    """

    tolerance = 1e-9  # [m / LENGTH_SCALE and rad] of a tool pose that is held

    def task(q: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the error to the wanted pose at q (m, N) [m, rad], and its Jacobian."""
        point, turn, J = tool_pose(chain, robot, q)
        J[:, :3] /= LENGTH_SCALE
        return np.hstack([(x[rows] - point) / LENGTH_SCALE, rotation_between(turn, R[rows])]), J

    found = solve_ik(task, q, step=_careful_step, iterations=iterations, tolerance=tolerance)
    return found.q, found.error <= tolerance


def _careful_step(J: Array, missing: Array) -> Array:
    """Far away the step is cautious, near the end it is Newton's; all joints together move 0.5 rad at most."""
    step = damped_step(J, missing, 1e-3 * np.einsum("ni,ni->n", missing, missing) + 1e-12)
    return shorten(step, np.linalg.norm(step, axis=1), 0.5)


def smallest_singular_value(chain: Chain, robot: Robot, q: Array) -> Array:
    """Return the smallest singular value of the tool's Jacobian, lengths in units of LENGTH_SCALE, (n,).

    It is 0 where the arm is singular.
    """
    _, _, J = tool_pose(chain, robot, q)
    J[:, :3] /= LENGTH_SCALE
    return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1])


def reaching_joints(chain: Chain, robot: Robot) -> tuple[int, ...]:
    """Return the three joints that lead the end of the chain to a point: the first that move it in all directions.

    Those of most arms are the first three; where they meet in a shoulder (arms of seven joints) they cannot.
    """
    states = 200  # drawn states tell which joints reach
    q = np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (states, robot.n_joints))
    screws = chain.forward(robot.theta(q)).point_screws(chain.joint_places)  # (N, 3, n) by theta
    sets = list(combinations(np.flatnonzero(~robot.slides).tolist(), 3))
    J = np.moveaxis(screws[np.array(sets)], 3, 1)  # (sets, n, 3 joints, 3)
    worth = np.median(np.linalg.svd(J, compute_uv=False)[..., -1], axis=1)
    return sets[int(np.argmax(worth > 0.2 * worth.max()))]  # of the best set's lever


def solve_point_ik(chain: Chain, robot: Robot, q: Array, p_B: Array) -> tuple[Array, Array]:
    """Move three joints of q (n, N) [rad] until the end of the chain lies on p_B (3,) [m], or nearest.

    The other joints stay, so every orientation and every posture of the arm that reaches the point comes up as often
    as the starts do. No wrist or elbow of a certain build is assumed (:func:`reaching_joints`). Whole turns are taken
    off where that brings a joint between its limits.

    Returns:
        The angles (n, N) [rad], and the distance from the point, (n,) [m].
    """
    moved = list(reaching_joints(chain, robot))
    end = next((k for k, t in enumerate(chain.transforms) if t.joint == moved[-1] + 1), len(chain))
    front, rest = Chain(chain.transforms[:end]), Chain(chain.transforms[end:])
    theta = robot.theta(q)
    arm = rest.carry(theta, np.zeros(3))  # (n, 3) [m] in the frame that the last of the three carries

    def task(three: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the vector from the tool point to the wanted point at q (m, N) [m], and its Jacobian."""
        angles = theta[rows]
        angles[:, moved] = three
        motion, moving = front.forward(angles), front.joint_places[moved]
        x = motion.x + np.einsum("ijn,nj->in", motion.R, arm[rows])
        J = np.cross(motion.u[moving], x - motion.p[moving], axis=1)  # (3 joints, 3, n)
        return p_B - x.T, np.moveaxis(J, (0, 1, 2), (2, 1, 0))

    start = theta[:, moved]
    found = solve_ik(task, start, step=_bold_step, iterations=14, tolerance=POINT_TOLERANCE, norm=2)
    missing = np.linalg.norm(task(found.q, np.arange(len(q)))[0], axis=1)
    theta[:, moved] = found.q
    solved = np.linalg.solve(robot.coupling_matrix, (theta - robot.theta_zero).T).T
    whole = TURN * np.round((solved - (robot.q_lower + robot.q_upper) / 2) / TURN)
    return np.asarray(solved - np.where(robot.slides, 0.0, whole)), missing


def retract_tool(chain: Chain, robot: Robot, q: Array, way: Array) -> tuple[Array, Array]:
    """Return the poses from which the tool comes: by ``way`` (3,) [m, flange frame] before q (n, N), turned as there.

    Returns:
        The poses (n, N) [rad], and by how much they miss, turns at a lever of the way, (n,) [m].
    """
    x, R, _ = tool_pose(chain, robot, q)
    goal = x - np.einsum("nij,j->ni", R, way)
    lever = float(np.linalg.norm(way))

    def task(q: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the errors to the point [m] and to the direction, and their Jacobian, at q (m, N)."""
        point, turn, J = tool_pose(chain, robot, q)
        sine = np.cross(turn, R[rows], axis=1).sum(axis=2) / 2
        return np.hstack([goal[rows] - point, sine]), J

    found = solve_ik(task, q, step=_bold_step, iterations=RETRACT_ITERATIONS, tolerance=POLISHED)
    missing, _ = task(found.q, np.arange(len(q)))
    return found.q, np.linalg.norm(missing[:, :3], axis=1) + lever * np.linalg.norm(missing[:, 3:], axis=1)


def shift_point(chain: Chain, robot: Robot, q: Array, way: Array) -> tuple[Array, Array]:
    """Return the nearest poses whose tool point lies by ``way`` (3,) [m, base frame] from that at q (n, N) [rad].

    The tool may turn, so that arms of few joints reach them too.

    Returns:
        The poses (n, N) [rad], and by how much they miss, (n,) [m].
    """
    goal = tool_pose(chain, robot, q)[0] + way

    def task(q: Array, rows: Positions) -> tuple[Array, Array]:
        """Return the error to the shifted point at q (m, N), and its Jacobian."""
        point, _, J = tool_pose(chain, robot, q)
        return goal[rows] - point, J[:, :3]

    found = solve_ik(task, q, step=_bold_step, iterations=RETRACT_ITERATIONS, tolerance=POLISHED, norm=2)
    return found.best, found.error


def _bold_step(J: Array, missing: Array) -> Array:
    """Damped by 1e-4 of the mean square of a column while far, no longer when near; no joint moves over 0.6 rad."""
    size = np.einsum("nij,nij->n", J, J) / J.shape[2]
    fade = np.minimum(1e-4, (missing**2).sum(axis=1))
    step = damped_step(J, missing, (fade + 1e-13) * size)
    return shorten(step, np.abs(step).max(axis=1), 0.6)
