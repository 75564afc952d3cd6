"""From a collision-free polyline to a timed trajectory: round the corners, bound the stretches, choose speeds, time."""

import numpy as np
from numpy.typing import ArrayLike

from planner.trajectory.corner import Corners, round_corners
from planner.trajectory.curve import Curve, build_curve, closest_passages
from planner.trajectory.limits import Index, Limits, Mask, Request, ToolJacobian, ToolPosition, checked
from planner.trajectory.profile import choose
from planner.trajectory.stretches import cut
from planner.trajectory.timing import Phases, stand_still, time_steps
from planner.trajectory.trajectory import Trajectory, evaluate
from planner.units import Array, frozen

PEAK_SAMPLES = 32  # of the tool's speed on each leg, for the report


def blend_corners(
    path_q: ArrayLike,
    *,
    stop: ArrayLike,
    blend_m: ArrayLike,
    tool_position: ToolPosition,
    limits: Limits,
    tool_speed: ArrayLike = np.inf,
) -> tuple[Array, Array, Mask]:
    """Return entry (m, N) and exit (m, N) [rad] of every blend and the stops (m,) that a trajectory will have.

    The driven path stays inside the triangles (entry, path point, exit) and on the straight legs between them: check
    these before timing. At stops, reversals and corners of radius 0 among them, both equal the path point.
    """
    request = checked(path_q, stop, blend_m, tool_speed, 0.0, len(limits.speed))
    corners = round_corners(request, tool_position, limits.speed)
    return corners.entry[corners.node], corners.exit[corners.node], corners.stop[corners.node]


def plan_trajectory(
    path_q: ArrayLike,
    *,
    stop: ArrayLike,
    blend_m: ArrayLike,
    tool_position: ToolPosition,
    tool_jacobian: ToolJacobian,
    limits: Limits,
    tool_speed: ArrayLike = np.inf,
    dwell: ArrayLike = 0.0,
) -> Trajectory:
    """Blend and time a polyline of controller angles path_q (m, N) [rad].

    stop (m,): rest exactly here (first and last always); a reversal and a corner of radius 0 become stops. blend_m, one
    or (m,) [m]: distance of the tool point from the corner at which a blend begins and ends, at most half the leg.
    tool_speed, one or (m-1,) [m/s]: limit of the tool point on each leg, inf for none. dwell, one or (m,) [s] at stops.
    Raises InputError where shapes or values do not fit. Same input, same trajectory, bit for bit.
    """
    request = checked(path_q, stop, blend_m, tool_speed, dwell, len(limits.speed))
    corners = round_corners(request, tool_position, limits.speed)
    curve = build_curve(corners)
    phases, reached = _time(request, corners, curve, tool_jacobian, limits)
    waypoint_time = _waypoint_times(reached, corners.node, request.dwell)
    leave = waypoint_time[:-1] + request.dwell[:-1]
    leg_duration = np.maximum(waypoint_time[1:] - leave, 0.0)
    t = leave[:, None] + np.linspace(0.0, 1.0, PEAK_SAMPLES + 1) * leg_duration[:, None]
    tool = evaluate(curve, phases, tool_jacobian, t.ravel()).tool_speed
    return Trajectory(
        duration_s=phases.duration,
        measuring_s=_measuring(request, leg_duration),
        waypoint_time=frozen(waypoint_time),
        dwell=request.dwell,
        stop=corners.stop[corners.node],
        leg_duration=frozen(leg_duration),
        leg_peak_tool_speed=frozen(tool.reshape(t.shape).max(axis=1)),
        tool_speed_limit=request.tool_speed,
        entry=frozen(corners.entry[corners.node]),
        exit=frozen(corners.exit[corners.node]),
        curve=curve,
        phases=phases,
        tool_jacobian=tool_jacobian,
    )


def _time(
    request: Request, corners: Corners, curve: Curve, jacobian: ToolJacobian, limits: Limits
) -> tuple[Phases, Array]:
    """Return s(t) and the time (M,) of reaching each distinct path point."""
    count = len(corners.q)
    wait = np.bincount(corners.node, weights=request.dwell, minlength=count)
    if count == 1:
        return stand_still(float(wait[0])), np.zeros(1)
    passage = closest_passages(curve, count)
    leg_limit = request.tool_speed[np.diff(corners.node) > 0]
    stretches = cut(curve, passage, corners.stop, leg_limit, jacobian, limits)
    at = np.searchsorted(stretches.edge, passage)
    pause = np.zeros(len(stretches.edge))
    pause[at] = wait
    phases, arrival = time_steps(choose(stretches, limits), stretches.edge, pause)
    return phases, np.where(corners.stop, arrival[at], phases.time_at(passage))


def _waypoint_times(reached: Array, node: Index, dwell: Array) -> Array:
    """Return when each path point (m,) is reached: repeated points wait for one another's dwell."""
    before = np.cumsum(dwell) - dwell
    return np.asarray(reached[node] + before - before[np.searchsorted(node, node)])


def _measuring(request: Request, leg_duration: Array) -> float:
    """Return the time [s] on legs with a tool-speed limit, and at rest at either end of them."""
    leg = np.isfinite(request.tool_speed)
    beside = np.append(leg, False) | np.insert(leg, 0, False)
    return float(leg_duration[leg].sum() + request.dwell[beside].sum())
