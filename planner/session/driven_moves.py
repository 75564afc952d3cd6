"""The legs of a timed path as joint moves, whose speeds and times keep the limits of tool and gauge however the
controller spreads a leg's time; and the blended path in small steps or circles where it cannot be blended."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.units import Array, to_mm
from planner.kinematics.geometry import bar_state, fit_circle_in_space, points_on_arc
from planner.motion.timing.curve import axis_percent
from planner.motion.timing.trajectory import Trajectory
from planner.programs.instructions import JointMove
from planner.runs.run import Mounting
from planner.session.plan_types import TimedPath
from planner.session.tolerances import (
    CUT_CORNER_SHARE,
    DENSE_TRAVEL,
    DENSE_TURN,
    EVEN_TIME_RATIO,
    LEG_SPEED_RATIO,
    OFF_CIRCLE,
    STEP_SPEED_RATIO,
    TURNED_TOOL,
)

LEG_SAMPLES = 65  # along a leg, for the largest travel of the tool point and change of the length


def joint_moves(cell: Cell, path: TimedPath, mounting: Mounting | None) -> list[JointMove]:
    """One joint move a leg of the path, with the blends that the trajectory has.

    ``mounting``: how the gauge is attached meanwhile, or ``None``.
    """
    robot, trajectory = cell.robot, path.trajectory
    percent = axis_percent(
        path.q,
        tool_speed=np.maximum(trajectory.leg_peak_tool_speed, 1e-6),
        tool_jacobian=cell.map_jacobian,
        speed=robot.speed,
    )
    highest = 100.0 if mounting is not None and cell.motion.is_continuous else 100.0 * cell.motion.travel
    run = _leg_travel(cell, path.q, mounting, LEG_SAMPLES, LEG_SPEED_RATIO)
    shortest = run.shortest_times(trajectory.tool_speed_limit, cell.gauge.rate)
    quickest = (np.abs(np.diff(path.q, axis=0)) / robot.speed).max(axis=1)
    percent = np.minimum(percent, 100.0 * quickest / np.maximum(shortest, 1e-9))
    tool = np.minimum(trajectory.leg_peak_tool_speed, cell.gauge.rate if mounting is not None else np.inf)
    radius = corner_radii(cell, path.q, trajectory)
    return [
        JointMove(
            degrees(path.q[k + 1]),
            duration_s=max(float(trajectory.leg_duration[k]), float(shortest[k]), 1e-3),
            tool_speed_mm_s=float(tool[k]) * 1e3,
            axis_percent=float(np.clip(percent[k], 0.01, highest)),
            blend_mm=0.0 if trajectory.stop[k + 1] else float(radius[k + 1]) * 1e3,
            pose=int(path.visit[k + 1]) if path.visit[k + 1] >= 0 else None,
            tool_travel_mm=float(run.point[k]) * 1e3,
            tool_limit_mm_s=float(trajectory.tool_speed_limit[k]) * 1e3,
            mounting=mounting,
            shortest_s=max(float(shortest[k]), float(quickest[k])),
        )
        for k in range(len(path.q) - 1)
    ]


def corner_radii(cell: Cell, q: Array, trajectory: Trajectory) -> Array:
    """Return how far from each point of a path (m, N) [rad] a program may let the tool leave it, (m,) [m].

    A controller has one distance for both legs of a corner: the smaller of the two that the trajectory has.
    """
    x = cell.map_position(q)
    one, other = (
        np.linalg.norm(cell.map_position(side[: len(q)]) - x, axis=1) for side in (trajectory.entry, trajectory.exit)
    )
    return np.asarray(np.minimum(one, other))


def even_moves(cell: Cell, q: Array, visit: np.ndarray, mounting: Mounting) -> list[JointMove]:
    """Return joint moves through points q (m, N) [rad], exact stops, within all limits if the joints move evenly."""
    limit = np.broadcast_to(cell.gauge.leg_speeds(cell, visit), (len(q) - 1,))
    run = _leg_travel(cell, q, mounting, LEG_SAMPLES, LEG_SPEED_RATIO)
    quickest = (np.abs(np.diff(q, axis=0)) / cell.robot.speed).max(axis=1)
    seconds = (
        np.maximum(run.shortest_times(limit, cell.gauge.rate), quickest / cell.motion.travel) * EVEN_TIME_RATIO + 1e-3
    )
    return [
        JointMove(
            degrees(q[k + 1]),
            duration_s=float(seconds[k]),
            tool_speed_mm_s=float(run.point[k] / seconds[k]) * 1e3,
            axis_percent=float(np.clip(100.0 * quickest[k] / seconds[k], 0.01, 100.0)) if quickest[k] else 100.0,
            tool_limit_mm_s=float(limit[k]) * 1e3,
            mounting=mounting,
        )
        for k in range(len(q) - 1)
    ]


@dataclass(frozen=True)
class LegTravel:
    """Largest |dx/ds| of the tool point and |dL/ds| of the attached gauge on each leg, s from 0 to 1, (m − 1,) [m]."""

    point: Array
    length: Array

    def shortest_times(self, tool_speed: Array, rate: float) -> Array:
        """Return the times in which even motion of the joints keeps both limits [m/s] throughout, (m − 1,) [s]."""
        return np.maximum(self.point / tool_speed, self.length / rate)


def _leg_travel(cell: Cell, q: Array, mounting: Mounting | None, samples: int, margin: float) -> LegTravel:
    leg, share = np.diff(q, axis=0), np.linspace(0.0, 1.0, samples)
    states = (q[:-1, None] + share[:, None] * leg[:, None]).reshape(-1, q.shape[1])
    J = cell.map_jacobian(states).reshape(len(leg), samples, 3, -1)
    velocity = np.einsum("lsij,lj->lsi", J, leg)
    point = np.linalg.norm(velocity, axis=2).max(axis=1) * margin
    if mounting is None or not np.isfinite(cell.gauge.rate):
        return LegTravel(point, np.zeros(len(leg)))
    along = bar_state(cell.map_position(states), cell.fixtures[mounting.fixture].p_BX).direction.reshape(velocity.shape)
    return LegTravel(point, np.abs(np.einsum("lsi,lsi->ls", velocity, along)).max(axis=1) * margin)


def dense_moves(
    cell: Cell, path: TimedPath, mounting: Mounting, block_s: float
) -> tuple[list[JointMove], dict[int, int]]:
    """Return the blended path in small steps, each with the time it takes; corners stay inside what was proven.

    ``block_s``: least time of a step [s]. Beside them: which step begins at which of the path's points, for the points
    before the poses.
    """
    trajectory, ids = path.trajectory, path.visit
    t = _dense_times(cell, trajectory, block_s)
    motion = trajectory.at(t)
    marks = {
        int(np.argmin(np.abs(t[1:] - s))): int(i)
        for s, i in zip(trajectory.waypoint_time[1:], ids[1:], strict=True)
        if i >= 0
    }
    limit = np.full(len(t) - 1, trajectory.tool_speed_limit.max())
    run = _leg_travel(cell, motion.q, mounting, 3, STEP_SPEED_RATIO)  # samples along a small step
    quickest = np.abs(np.diff(motion.q, axis=0)) / cell.robot.speed
    least = np.maximum(run.shortest_times(limit, cell.gauge.rate), quickest.max(axis=1)).tolist()
    step = np.maximum(np.diff(t), run.shortest_times(limit, cell.gauge.rate))
    full = quickest / step[:, None] * 100
    out = []
    for k in range(len(step)):
        speed = float(motion.tool_speed[k : k + 2].max()) * 1e3
        percent = float(np.clip(full[k].max(), 0.01, 100.0))
        rest = k + 1 == len(step) or motion.tool_speed[k + 1] == 0.0
        blend, pose = 0.0 if rest else 1e3 * DENSE_TRAVEL / 2, marks.get(k)
        angles = degrees(motion.q[k + 1])
        out.append(
            JointMove(
                angles, float(step[k]), speed, percent, blend, pose, None, float(limit[k]) * 1e3, mounting, least[k]
            )
        )
    before = np.flatnonzero(ids[1:] >= 0)
    return out, {int(np.argmin(np.abs(t[:-1] - trajectory.waypoint_time[w]))): int(w) for w in before}


def _dense_times(cell: Cell, trajectory: Trajectory, shortest: float) -> Array:
    """Times at which the path is written: at every waypoint, and between them in steps that a controller prepares."""
    fine = np.unique(np.concatenate([trajectory.sample_times(0.02), trajectory.waypoint_time]))
    motion = trajectory.at(fine)
    x = cell.map_position(motion.q)
    travel = np.linalg.norm(np.diff(x, axis=0), axis=1) / DENSE_TRAVEL
    turn = np.abs(np.diff(motion.q, axis=0)).max(axis=1) / DENSE_TURN
    covered = np.concatenate([[0.0], np.cumsum(np.maximum(travel, turn))])
    count = int(np.ceil(covered[-1]))
    even = np.interp(np.arange(count + 1) * covered[-1] / max(count, 1), covered, fine)
    points = np.unique(trajectory.waypoint_time)
    points = points[np.concatenate([[True], np.diff(points) > 5e-3])]  # [s] apart: nearer waypoints are written as one
    after = np.clip(np.searchsorted(points, even), 1, len(points) - 1)
    gap = np.minimum(np.abs(even - points[after - 1]), np.abs(points[after] - even))
    kept = _keep_apart(even, shortest)
    written = np.unique(np.concatenate([even[kept & (gap >= shortest)], points]))
    if not kept.all() and _cut_corner(cell, trajectory, written) > CUT_CORNER_SHARE:
        raise InputError(
            f"blocks of {1e3 * shortest:g} ms are so long that straight ones would leave the curved path by over "
            f"{to_mm(CUT_CORNER_SHARE * DENSE_TRAVEL):g} mm: lower controller.block_ms or motion.tool_speed_mm_min"
        )
    return written


def _cut_corner(cell: Cell, trajectory: Trajectory, t: Array) -> float:
    """Return how far the path leaves straight steps, at the middle of each, at most, as a share of a small step.

    Where the robot gathers speed it is elsewhere on the same straight step: that leaves nothing.
    """
    middle, q = trajectory.at((t[1:] + t[:-1]) / 2).q, trajectory.at(t).q
    step = np.diff(q, axis=0)
    along = np.einsum("ni,ni->n", middle - q[:-1], step) / np.maximum(np.einsum("ni,ni->n", step, step), 1e-24)
    straight = q[:-1] + np.clip(along, 0.0, 1.0)[:, None] * step
    off = np.linalg.norm(cell.map_position(straight) - cell.map_position(middle), axis=1) / DENSE_TRAVEL
    turned = np.abs(straight - middle).max(axis=1) / DENSE_TURN
    return float(np.maximum(off, turned).max(initial=0.0))


def _keep_apart(times: Array, shortest: float) -> np.ndarray:
    """Tell which of ascending times (n,) [s] to keep so that none follows the one before sooner, (n,) bool."""
    kept, last = np.zeros(len(times), dtype=bool), -np.inf
    for k, time in enumerate(times):
        if time - last >= shortest:
            kept[k], last = True, time
    return kept


def degrees(q: Array) -> tuple[float, ...]:
    """Return joint angles (N,) [rad] in degrees."""
    return tuple(float(v) for v in np.rad2deg(q))


def circle_moves(cell: Cell, path: TimedPath, mounting: Mounting) -> list[JointMove] | None:
    """Return the pieces of a circle, or nothing where the path is none, or the tool turns on it.

    A piece ends at every mark of the path.
    """
    longest_piece = np.deg2rad(120.0)  # controllers allow 180 to 240 degrees
    robot, x = cell.robot, cell.map_position(path.q)
    R = np.moveaxis(robot.chain.forward(robot.theta(path.q)).R, 2, 0)
    found = _circle_angles(x, R)
    if found is None or (path.trajectory.stop[1:-1]).any():
        return None
    edges = np.unique([0, *np.flatnonzero(path.visit >= 0), len(path.q) - 1])
    steps = joint_moves(cell, path, mounting)
    ends = [0]
    for a, b in pairwise(edges):
        count = int(min(np.ceil((found[b] - found[a]) / longest_piece), (b - a) // 2))
        if count == 0:  # two points have no middle: a joint move would have to stop at both
            return None
        ends += [int(e) for e in np.round(np.linspace(a, b, count + 1))[1:]]
    return [_piece(path, steps[a:b], x[[a, (a + b) // 2, b]], a, b) for a, b in pairwise(ends)]


def _piece(path: TimedPath, steps: list[JointMove], x: Array, a: int, b: int) -> JointMove:
    """Return the move from point a of the path to point b, through the one in the middle; x (3, 3) [m]."""
    time, last = path.trajectory.waypoint_time, b == len(path.q) - 1
    return JointMove(
        degrees(path.q[b]),
        duration_s=float(time[b] - time[a]),
        tool_speed_mm_s=min(max(s.tool_speed_mm_s for s in steps), min(s.tool_limit_mm_s for s in steps)),
        axis_percent=100.0,
        blend_mm=0.0 if last else 1.0,  # [mm] from one piece of a circle to the next
        pose=int(path.visit[b]) if path.visit[b] >= 0 else None,
        tool_travel_mm=points_on_arc(x, np.zeros(1))[1] * 1e3,
        tool_limit_mm_s=min(s.tool_limit_mm_s for s in steps),
        mounting=steps[0].mounting,
        via_deg=degrees(path.q[(a + b) // 2]),
    )


def _circle_angles(x: Array, R: Array) -> Array | None:
    """Return the angles (m,) [rad] at which points x (m, 3) [m] lie on one circle; ``None`` where they lie on none."""
    if len(x) < 3 or np.abs(R - R[0]).max() > TURNED_TOOL:
        return None
    centre, axes, radius = fit_circle_in_space(x)
    u, v, height = axes @ (x - centre).T
    if max(np.abs(np.hypot(u, v) - radius).max(), np.abs(height).max()) > OFF_CIRCLE:
        return None
    angle = np.unwrap(np.arctan2(v, u))
    angle = (angle - angle[0]) * np.sign(angle[-1] - angle[0])
    return angle if (np.diff(angle) > 0.0).all() else None
