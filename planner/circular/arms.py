"""How the arm may go round a circle: every tool orientation and configuration of the start pose, followed round."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

from planner.cell import Cell, Circle
from planner.circular.geometry import coarse_angles, orientations
from planner.circular.inverse import conditioning, held
from planner.errors import NoSolutionError
from planner.units import Array, to_deg
from planner.workspace import ROOM, Workspace

SPINS = 24  # orientations about each tool axis
SEEDS = 6  # log2 of the arm positions from which each start pose is looked for
SEARCH, FOLLOW = 40, 8  # rounds of Newton for a start pose, and from one place to the next
LEAP = 0.6  # [rad] no joint may move more from one place to the next: it would be another configuration
SAME = 1e-4  # [rad] start poses nearer than this are one


@dataclass(frozen=True)
class Ways:
    """Ways round a circle that keep limits, cones and cable, the roomiest first.

    Attributes:
        angle: places along the circle (k,) [rad].
        q: controller angles there, (m, k, N) [rad].
        R_BF: tool orientation at the first of them, (m, 3, 3).
        room: smallest distance from limits, cones and singularities, (m,) [rad].
        told: how many start poses were found and what became of them.
    """

    angle: Array
    q: Array
    R_BF: Array
    room: Array
    told: str


def ways_round(cell: Cell, circle: Circle, seed: int = 0) -> Ways:
    """Find every way round a circle.

    Raises:
        NoSolutionError: there is none; the message says how far the best comes and what stops it there.
    """
    if cell.robot.n_joints < 6:
        raise NoSolutionError(
            f"circle {circle.name}: {cell.robot.name} has {cell.robot.n_joints} joints; to hold a tool's orientation "
            "along a circle takes six"
        )
    angle = coarse_angles(circle)
    held_at, turned = _starts(cell, circle, angle[0], seed)
    over = np.maximum(cell.robot.q_lower - held_at, held_at - cell.robot.q_upper)
    inside = (over < 0.0).all(axis=1)
    if not inside.any():
        raise NoSolutionError(_unreached(circle, angle[0], over))
    start, R = held_at[inside], turned[inside]
    q, reached = _followed(cell, circle, angle, start, R)
    margins = _margins(cell, circle, q)  # (m, k, columns)
    margins[np.arange(len(angle)) >= reached[:, None]] = -np.inf
    whole = (margins > 0.0).all(axis=(1, 2))
    if not whole.any():
        raise NoSolutionError(_refused(cell, circle, angle, margins, reached))
    kept = np.flatnonzero(whole)
    turns = [stage != "workspace" for stage, _ in _workspace(cell, circle).columns]
    room = np.minimum(margins[kept][:, :, turns].min(axis=(1, 2)), _condition(cell, q[kept]))
    order = kept[np.argsort(-np.round(room, 6), kind="stable")]
    told = f"{len(start)} configurations of the start pose, {len(kept)} of them follow the circle within all limits"
    return Ways(angle, q[order], R[order], np.sort(room)[::-1], told)


def tool_axes(circle: Circle) -> Iterator[Array]:
    """Directions (3,) of the tool's ball-joint axis that are tried: those at which the bar tilts least against it."""
    if circle.axis_B is not None:
        yield circle.axis_B
        return
    n = circle.normal
    yield from (n, -n)
    if circle.sweep < 1.5 * np.pi:
        centre = circle.points(np.array([circle.start + circle.sweep / 2]))[0]
        inward = (circle.p_BC - centre) / circle.radius
        yield from (v / np.linalg.norm(v) for v in (inward, inward + n, inward - n))


def _starts(cell: Cell, circle: Circle, angle: float, seed: int) -> tuple[Array, Array]:
    """Distinct configurations (m, N) [rad] of all start poses, limits not looked at, with orientations (m, 3, 3)."""
    robot = cell.robot
    spin = Rotation.from_rotvec(np.linspace(0, 2 * np.pi, SPINS, endpoint=False)[:, None] * cell.tool.axis_F)
    R = np.concatenate([_aligned(cell.tool.axis_F, a) @ spin.as_matrix() for a in tool_axes(circle)])
    low, high = np.maximum(robot.q_lower, -np.pi), np.minimum(robot.q_upper, np.pi)
    unit = qmc.Sobol(robot.n_joints, seed=seed).random_base2(SEEDS)
    which = np.repeat(np.arange(len(R)), len(unit))
    q = np.tile(low + unit * (high - low), (len(R), 1))
    x = np.broadcast_to(circle.points(np.array([angle])), (len(q), 3))
    q, good = held(cell, q, x, R[which], SEARCH)
    q, which = _turned(cell, q[good]), which[good]
    _, first = np.unique(np.round(np.column_stack([which, q / SAME])).astype(int), axis=0, return_index=True)
    return q[first], R[which[first]]


def _aligned(axis_F: Array, axis_B: Array) -> Array:
    """Return a rotation (3, 3) that takes one unit vector to the other."""
    return np.asarray(Rotation.align_vectors(axis_B[None], axis_F[None])[0].as_matrix())


def _turned(cell: Cell, q: Array) -> Array:
    """Take whole turns off every joint's angle (n, N) [rad], to where it is nearest to home within the limits."""
    robot = cell.robot
    turn = 2 * np.pi * np.linalg.inv(robot.sense_matrix).T  # row j: what a whole turn of row j's angle is in q
    for step in turn:
        options = q[:, None] + np.arange(-3, 4)[:, None] * step
        over = np.maximum(robot.q_lower - options, options - robot.q_upper).clip(min=0.0).sum(axis=2)
        cost = 1e3 * over + np.abs(options - cell.home).sum(axis=2)
        q = options[np.arange(len(q)), cost.argmin(axis=1)]
    return q


def _followed(cell: Cell, circle: Circle, angle: Array, start: Array, R: Array) -> tuple[Array, np.ndarray]:
    """Follow all start poses (m, N) round; return q (m, k, N) [rad] and at how many places (m,) each stands."""
    x, m = circle.points(angle), len(start)
    q = np.repeat(start[:, None], len(angle), axis=1)
    reached, alive = np.ones(m, dtype=int), np.arange(m)
    for k in range(1, len(angle)):
        last = q[alive, k - 1]
        guess = last if k == 1 else 2 * last - q[alive, k - 2]
        wanted = np.concatenate([orientations(circle, angle[k : k + 1], r) for r in R[alive]])
        q[alive, k], good = held(cell, guess, np.tile(x[k], (len(alive), 1)), wanted, FOLLOW)
        good &= np.abs(q[alive, k] - last).max(axis=1) < LEAP
        alive = alive[good]
        reached[alive] = k + 1
        if not len(alive):
            break
    return q, reached


def _workspace(cell: Cell, circle: Circle) -> Workspace:
    return Workspace(cell.unwound, circle.fixture)


def _margins(cell: Cell, circle: Circle, q: Array) -> Array:
    """Margins (m, k, columns) [rad or m] less what a path keeps from every limit."""
    m, k, n = q.shape
    return np.asarray(_workspace(cell, circle).margins(q.reshape(-1, n)).reshape(m, k, -1) - ROOM / 2)


def _condition(cell: Cell, q: Array) -> Array:
    m, k, n = q.shape
    return np.asarray(conditioning(cell, q.reshape(-1, n)).reshape(m, k).min(axis=1))


def _unreached(circle: Circle, angle: float, over: Array) -> str:
    """Say why the beginning is not reached: not at all, or by how much a joint's limit (over (m, N) [rad]) misses."""
    tried = SPINS * len(list(tool_axes(circle)))
    where = f"circle {circle.name}: the robot does not reach its beginning at {to_deg(angle):.0f}°"
    why = f"none of {tried} tool orientations there is within its arm's length"
    if len(over):
        best = int(np.argmin(over.max(axis=1)))
        joint = int(np.argmax(over[best]))
        why = (
            f"in all of {len(over)} configurations a joint's limit is exceeded, in the nearest that of joint "
            f"{joint + 1} by {to_deg(over[best, joint]):.1f}°"
        )
    return f"{where}: {why}; move the fixture nearer, change start_deg or radius_mm, or give tool_axis"


def _refused(cell: Cell, circle: Circle, angle: Array, margins: Array, reached: np.ndarray) -> str:
    """Say how far the best way comes and what stops it."""
    good = margins.min(axis=2) > 0.0
    far = np.argmin(good, axis=1)  # none is good all along
    k = int(far.max())
    best = int(np.argmax(np.where(far == k, margins[:, k].min(axis=1), -np.inf)))  # of the furthest, the least beyond
    if k >= reached[best]:
        why = "the arm cannot reach further in this configuration"
    else:
        why = f"{_workspace(cell, circle).columns[int(np.argmin(margins[best, k]))][1]} is exceeded"
    way = f"from {to_deg(angle[0]):.0f}° to {to_deg(angle[k]):.0f}°"
    return (
        f"circle {circle.name}: none of {len(good)} configurations of the start pose leads round; the best comes "
        f"{way}, where {why}: change start_deg, overshoot_deg, tool_axis, radius_mm or the fixture's place, or widen "
        "gauge.cone_deg"
    )
