"""Arm configurations that follow a circle: points, tool orientations, start poses, limits."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.circular.assumptions import DRIVABLE
from planner.circular.plan import Circle
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import MM, Array, to_deg, to_mm
from planner.kinematics.geometry import bar_state
from planner.kinematics.inverse_kinematics import smallest_singular_value, solve_pose_ik

COARSE_STEP = np.deg2rad(5.0)  # [rad] between the places that decide which way round is taken


def driven_span(circle: Circle) -> tuple[float, float]:
    """First and last angle that is driven, overshoot included [rad]."""
    return circle.start - circle.overshoot, circle.start + circle.sweep + circle.overshoot


def coarse_angles(circle: Circle) -> Array:
    """Angles (k,) [rad] over all that is driven, a few degrees apart."""
    first, last = driven_span(circle)
    return _even_angles(first, last, COARSE_STEP)


def fine_angles(circle: Circle) -> Array:
    """Angles (m,) [rad] of the points that are driven; both ends of the sweep are among them."""
    coarsest = np.deg2rad(2.0)  # [rad] between points at most
    sagitta = 1e-6  # [m] between the circle and the straight line from point to point
    # 0.03: [s] from point to point at least: controllers plan no quicker
    step = max(np.sqrt(8.0 * sagitta / circle.radius), 0.03 * circle.speed / circle.radius)
    step = min(step, coarsest)
    low, high = driven_span(circle)
    edges = (low, circle.start, circle.start + circle.sweep, high)
    parts = [_even_angles(a, b, step) for a, b in pairwise(edges) if b > a]
    return np.append(np.concatenate([p[:-1] for p in parts]), high)


def orientations(circle: Circle, angle: Array, R_BF: Array) -> Array:
    """Tool orientations (n, 3, 3) at angles (n,) [rad], that is R_BF (3, 3) at the first angle driven.

    It is kept, or turned about the circle's normal with the bar.
    """
    turn = (angle - driven_span(circle)[0]) * circle.follows
    return np.asarray(Rotation.from_rotvec(turn[:, None] * circle.normal).as_matrix() @ R_BF)


def check_bar(cell: Cell, circle: Circle) -> None:
    """Refuse a circle on which the bar would have to be shorter or longer than it can be.

    Raises:
        InputError: naming the angle, the length wanted there and the bar's range.
    """
    angle = fine_angles(circle)
    length = bar_state(circle.points(angle), cell.fixtures[circle.fixture].p_BX).length
    low, high = cell.gauge.length_min + SAFETY_MARGIN, cell.gauge.length_max - SAFETY_MARGIN
    worst = int(np.argmax(np.maximum(low - length, length - high)))
    if low <= length[worst] <= high:
        return
    name = cell.fixtures[circle.fixture].name
    raise InputError(
        f"{cell.path}: circle {circle.name} (radius {circle.radius / MM:g} mm) about fixture {name} needs a bar of"
        f" {to_mm(length[worst]):.1f} mm at {to_deg(angle[worst]):.0f}°, it goes from {to_mm(low):g} to {to_mm(high):g}"
        f" mm ({to_mm(SAFETY_MARGIN):g} mm kept from either end): change radius_mm or centre_mm, or take another bar"
    )


def _even_angles(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, 1 + int(np.ceil((high - low) / step - 1e-9)))


TOOL_SPINS = 24  # orientations about each tool axis: every 15 degrees


@dataclass(frozen=True)
class ArmPaths:
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


def find_arm_paths(cell: Cell, circle: Circle, seed: int = 0) -> ArmPaths:
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
    held_at, turned = _start_poses(cell, circle, angle[0], seed)
    over = np.maximum(cell.robot.q_lower - held_at, held_at - cell.robot.q_upper)
    inside = (over < 0.0).all(axis=1)
    if not inside.any():
        raise NoSolutionError(_explain_unreached_start(circle, angle[0], over))
    start, R = held_at[inside], turned[inside]
    x = np.broadcast_to(circle.points(angle), (len(start), len(angle), 3))
    q, reached = follow_poses(cell, start, x, np.array([orientations(circle, angle, r) for r in R]))
    margins = _margins(cell, circle, q)  # (m, k, columns)
    margins[np.arange(len(angle)) >= reached[:, None]] = -np.inf
    whole = (margins > 0.0).all(axis=(1, 2))
    if not whole.any():
        raise NoSolutionError(_explain_refused_path(cell, circle, angle, margins, reached))
    kept = np.flatnonzero(whole)
    turns = [stage != "workspace" for stage, _ in _workspace(cell, circle).columns]
    room = np.minimum(margins[kept][:, :, turns].min(axis=(1, 2)), _condition(cell, q[kept]))
    order = kept[np.argsort(-np.round(room, 6), kind="stable")]
    told = f"{len(start)} configurations of the start pose, {len(kept)} of them follow the circle within all limits"
    return ArmPaths(angle, q[order], R[order], np.sort(room)[::-1], told)


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


def _start_poses(cell: Cell, circle: Circle, angle: float, seed: int) -> tuple[Array, Array]:
    """Distinct configurations (m, N) [rad] of all start poses, limits not looked at, with orientations (m, 3, 3)."""
    from scipy.stats import qmc  # costs most of a second

    same = 1e-4  # [rad] start poses nearer than this are one
    robot = cell.robot
    R = rotated_orientations(cell.tool.axis_F, tool_axes(circle), TOOL_SPINS)
    low, high = robot.one_turn
    # 64 arm positions from which each start pose is looked for
    unit = qmc.Sobol(robot.n_joints, seed=seed).random_base2(6)
    which = np.repeat(np.arange(len(R)), len(unit))
    q = np.tile(low + unit * (high - low), (len(R), 1))
    x = np.broadcast_to(circle.points(np.array([angle])), (len(q), 3))
    q, good = solve_pose_ik(cell.chain, cell.robot, q, x, R[which], 40)  # rounds of Newton for a start pose
    q, which = _remove_turns(cell, q[good]), which[good]
    _, first = np.unique(np.round(np.column_stack([which, q / same])).astype(int), axis=0, return_index=True)
    return q[first], R[which[first]]


def rotated_orientations(axis_F: Array, axes_B: Iterable[Array], spins: int) -> Array:
    """Orientations (m · spins, 3, 3) that bring a tool's axis along each of m unit vectors, evenly turned about it."""
    turn = np.arange(spins)[:, None] * (2 * np.pi / spins)
    spin = Rotation.from_rotvec(turn * axis_F).as_matrix()
    return np.concatenate([Rotation.align_vectors(a[None], axis_F[None])[0].as_matrix() @ spin for a in axes_B])


def _remove_turns(cell: Cell, q: Array) -> Array:
    """Take whole turns off every joint's angle (n, N) [rad], to where it is nearest to home within the limits."""
    robot = cell.robot
    turn = 2 * np.pi * np.linalg.inv(robot.coupling_matrix).T  # row j: what a whole turn of row j's angle is in q
    for step in turn[~robot.slides]:
        options = q[:, None] + np.arange(-3, 4)[:, None] * step
        over = np.maximum(robot.q_lower - options, options - robot.q_upper).clip(min=0.0).sum(axis=2)
        cost = 1e3 * over + np.abs(options - cell.home).sum(axis=2)
        q = options[np.arange(len(q)), cost.argmin(axis=1)]
    return q


def follow_poses(cell: Cell, start: Array, x: Array, R: Array, lead: float = 1.0) -> tuple[Array, np.ndarray]:
    """Follow tool poses one after the other, each looked for from the one before it.

    Args:
        cell: the cell.
        start: controller angles of the first poses, (m, N) [rad].
        x, R: positions (m, k, 3) [m] and orientations (m, k, 3, 3) of the tool.
        lead: how much of the step before is taken ahead of the search.

    Returns:
        q (m, k, N) [rad], and at how many of its poses (m,) each stands without a leap.
    """
    m, k = x.shape[:2]
    q = np.repeat(start[:, None], k, axis=1)
    reached, alive = np.ones(m, dtype=int), np.arange(m)
    for i in range(1, k):
        if not len(alive):
            break
        last = q[alive, i - 1]
        guess = last if i == 1 else (1.0 + lead) * last - lead * q[alive, i - 2]
        # 8: rounds from one place to the next
        q[alive, i], good = solve_pose_ik(cell.chain, cell.robot, guess, x[alive, i], R[alive, i], 8)
        good &= np.abs(q[alive, i] - last).max(axis=1) < DRIVABLE.largest_step
        alive = alive[good]
        reached[alive] = i + 1
    return q, reached


def _workspace(cell: Cell, circle: Circle) -> Workspace:
    return Workspace(cell.without_twist, circle.mounting)


def _margins(cell: Cell, circle: Circle, q: Array) -> Array:
    """Margins (m, k, columns) [rad or m] less what a path keeps from every limit."""
    m, k, n = q.shape
    return np.asarray(_workspace(cell, circle).margins(q.reshape(-1, n)).reshape(m, k, -1) - SAFETY_MARGIN / 2)


def _condition(cell: Cell, q: Array) -> Array:
    m, k, n = q.shape
    return np.asarray(smallest_singular_value(cell.chain, cell.robot, q.reshape(-1, n)).reshape(m, k).min(axis=1))


def _explain_unreached_start(circle: Circle, angle: float, over: Array) -> str:
    """Say why the beginning is not reached: not at all, or by how much a joint's limit (over (m, N) [rad]) misses."""
    tried = TOOL_SPINS * len(list(tool_axes(circle)))
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


def _explain_refused_path(cell: Cell, circle: Circle, angle: Array, margins: Array, reached: np.ndarray) -> str:
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
