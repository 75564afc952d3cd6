"""The timed tour: planning, exact evaluation, limits check and table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from planner.common.lazy_modules import pl
from planner.common.units import Array, Rows, read_only, to_deg, to_mm
from planner.motion.timing.curve import (
    Corners,
    Index,
    Limits,
    Mask,
    PathCurve,
    ReadingLimits,
    TimingRequest,
    ToolJacobian,
    ToolPosition,
    build_curve,
    check_request,
    closest_passages,
    round_corners,
)
from planner.motion.timing.phases import Phases, stand_still, time_steps
from planner.motion.timing.profile import choose_speeds, cut_stretches


@dataclass(frozen=True)
class MotionSamples(Rows):
    """The state at n times: t (n,) [s]; q, dq, ddq, dddq (n, N) [rad, /s, /s², /s³]; s [m], tool_speed [m/s], (n,)."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    dddq: Array
    s: Array
    tool_speed: Array


@dataclass(frozen=True)
class Trajectory:
    """A tour over m path points, blended and timed.

    duration_s; measuring_s, the part on legs with a tool-speed limit and at rest beside them; waypoint_time (m,) [s] of
    coming to rest at a stop, or of closest passage (in joint space) where blended; dwell (m,) [s]; stop (m,), forced
    stops included; leg_duration (m-1,) [s] of moving, leg_peak_tool_speed and tool_speed_limit (m-1,) [m/s]; entry and
    exit (m, N) [rad] of each blend: the path stays inside the triangles (entry, point, exit) and on the legs.
    """

    duration_s: float
    measuring_s: float
    waypoint_time: Array
    dwell: Array
    stop: Mask
    leg_duration: Array
    leg_peak_tool_speed: Array
    tool_speed_limit: Array
    entry: Array
    exit: Array
    curve: PathCurve = field(repr=False)
    phases: Phases = field(repr=False)
    tool_jacobian: ToolJacobian = field(repr=False, compare=False)

    def at(self, t: ArrayLike) -> MotionSamples:
        """Return the state at times t (n,) [s], held at rest outside [0, duration_s]."""
        part = 8192  # times evaluated at once: what they need stays in the processor's cache
        t = np.atleast_1d(np.asarray(t, dtype=float))
        parts = [
            evaluate_motion(self.curve, self.phases, self.tool_jacobian, t[k : k + part])
            for k in range(0, max(len(t), 1), part)
        ]
        return MotionSamples.concatenate(parts)

    def angles(self, t: ArrayLike) -> Array:
        """Return the joint angles at times t (n,) [s], (n, N) [rad]; quicker than all of :meth:`at`."""
        s, *_, end = self.phases.at(np.clip(np.atleast_1d(np.asarray(t, dtype=float)), 0.0, self.phases.duration))
        return self.curve.points(s, np.minimum(self.curve.piece(s), self.curve.last_piece(end)))

    def sample(self, dt: float) -> MotionSamples:
        """Return the state every ``dt`` [s] from 0, and at the end."""
        return self.at(self.sample_times(dt))

    def sample_times(self, dt: float) -> Array:
        """Return 0, dt, 2 dt, … and duration_s."""
        return np.append(np.arange(np.ceil(self.duration_s / dt - 1e-9)) * dt, self.duration_s)


def evaluate_motion(curve: PathCurve, phases: Phases, jacobian: ToolJacobian, t: Array) -> MotionSamples:
    """Return the state at times t (n,): the chain rule through q(s) and s(t)."""
    s, v, a, j, end = phases.at(np.clip(t, 0.0, phases.duration))
    # what ends at a stop stays on its own piece, though rounding may put s past it
    q, d1, d2, d3 = curve.derivatives(s, np.minimum(curve.piece(s), curve.last_piece(end)))
    v, a, j = v[:, None], a[:, None], j[:, None]
    dq = d1 * v
    ddq = d2 * v**2 + d1 * a
    dddq = d3 * v**3 + 3.0 * d2 * v * a + d1 * j
    tool_speed = np.linalg.norm(np.einsum("nij,nj->ni", jacobian(q), dq), axis=1)
    return MotionSamples(t, q, dq, ddq, dddq, s, tool_speed)


def blend_corners(
    path_q: ArrayLike,
    *,
    stop: ArrayLike,
    blend_m: ArrayLike,
    tool_position: ToolPosition,
    limits: Limits,
    tool_speed: ArrayLike = np.inf,
) -> tuple[Array, Array, Mask]:
    """Return where each blend begins and ends, (m, N) [rad] each, and which corners (m,) the trajectory stops at.

    The driven path stays inside the triangles (entry, path point, exit) and on the straight legs between them: check
    these before timing. At stops, reversals and corners of radius 0 among them, both equal the path point.
    """
    request = check_request(path_q, stop, blend_m, tool_speed, 0.0, len(limits.speed))
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
    reading: ReadingLimits | None = None,
) -> Trajectory:
    """Blend and time a polyline of controller angles path_q (m, N) [rad].

    stop (m,): rest exactly here (first and last always); a reversal and a corner of radius 0 become stops. blend_m, one
    or (m,) [m]: distance of the tool point from the corner at which a blend begins and ends, at most half the leg.
    tool_speed, one or (m-1,) [m/s]: limit of the tool point on each leg, inf for none. dwell, one or (m,) [s] at stops.
    reading: limits of the gauge that is held at the tool. Raises InputError where shapes or values do not fit. Same
    input, same trajectory, bit for bit.
    """
    request = check_request(path_q, stop, blend_m, tool_speed, dwell, len(limits.speed))
    corners = round_corners(request, tool_position, limits.speed)
    curve = build_curve(corners)
    phases, reached = _time_curve(request, corners, curve, tool_jacobian, limits, reading)
    waypoint_time = _waypoint_times(reached, corners.node, request.dwell)
    leave = waypoint_time[:-1] + request.dwell[:-1]
    leg_duration = np.maximum(waypoint_time[1:] - leave, 0.0)
    samples = 32  # of the tool's speed on each leg, for the report
    t = leave[:, None] + np.linspace(0.0, 1.0, samples + 1) * leg_duration[:, None]
    tool = evaluate_motion(curve, phases, tool_jacobian, t.ravel()).tool_speed
    return Trajectory(
        duration_s=phases.duration,
        measuring_s=_measuring_time(request, leg_duration),
        waypoint_time=read_only(waypoint_time),
        dwell=request.dwell,
        stop=corners.stop[corners.node],
        leg_duration=read_only(leg_duration),
        leg_peak_tool_speed=read_only(tool.reshape(t.shape).max(axis=1)),
        tool_speed_limit=request.tool_speed,
        entry=read_only(corners.entry[corners.node]),
        exit=read_only(corners.exit[corners.node]),
        curve=curve,
        phases=phases,
        tool_jacobian=tool_jacobian,
    )


def _time_curve(
    request: TimingRequest,
    corners: Corners,
    curve: PathCurve,
    jacobian: ToolJacobian,
    limits: Limits,
    reading: ReadingLimits | None,
) -> tuple[Phases, Array]:
    """Return s(t) and the time (M,) of reaching each distinct path point."""
    count = len(corners.q)
    wait = np.bincount(corners.node, weights=request.dwell, minlength=count)
    if count == 1:
        return stand_still(float(wait[0])), np.zeros(1)
    passage = closest_passages(curve, count)
    leg_limit = request.tool_speed[np.diff(corners.node) > 0]
    limits = limits if reading is None else reading.with_reading(limits)
    stretches = cut_stretches(curve, passage, corners.stop, leg_limit, jacobian, limits, reading)
    at = np.searchsorted(stretches.edge, passage)
    pause = np.zeros(len(stretches.edge))
    pause[at] = wait
    phases, arrival = time_steps(choose_speeds(stretches, limits), stretches.edge, pause)
    return phases, np.where(corners.stop, arrival[at], phases.time_at(passage))


def _waypoint_times(reached: Array, node: Index, dwell: Array) -> Array:
    """Return when each path point (m,) is reached: repeated points wait for one another's dwell."""
    before = np.cumsum(dwell) - dwell
    return np.asarray(reached[node] + before - before[np.searchsorted(node, node)])


def _measuring_time(request: TimingRequest, leg_duration: Array) -> float:
    """Return the time [s] on legs with a tool-speed limit, and at rest at either end of them."""
    leg = np.isfinite(request.tool_speed)
    beside = np.append(leg, False) | np.insert(leg, 0, False)
    return float(leg_duration[leg].sum() + request.dwell[beside].sum())


INSIDE = np.array([1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9])  # of every phase: jerk jumps at its ends


@dataclass(frozen=True)
class LimitReport:
    """Largest use of each limit as a share of it: speed, acceleration, jerk (N,) per joint; tool_speed of any leg.

    ``reading_rate`` and ``reading_acceleration`` are of the gauge that is held at the tool, zero without one.
    """

    speed: Array
    acceleration: Array
    jerk: Array
    tool_speed: float
    reading_rate: float = 0.0
    reading_acceleration: float = 0.0


def check_limits(
    trajectory: Trajectory, limits: Limits, dt_s: float = 0.01, reading: ReadingLimits | None = None
) -> LimitReport:
    """Compare with the limits samples every ``dt_s`` [s], and five in every phase of the profile.

    A reading is compared by differences of the lengths themselves, not by the derivatives that the timing uses.
    """
    start = trajectory.phases.t
    length = np.diff(np.append(start, trajectory.duration_s))
    inner = (start[:, None] + length[:, None] * INSIDE).ravel()
    t = np.sort(np.concatenate([trajectory.sample_times(dt_s), inner]))
    motion = trajectory.at(t)
    leg = np.clip(np.searchsorted(trajectory.waypoint_time, t, side="left") - 1, 0, None)
    leg = np.minimum(leg, len(trajectory.tool_speed_limit) - 1)
    return LimitReport(
        read_only(np.abs(motion.dq).max(axis=0) / limits.speed),
        read_only(np.abs(motion.ddq).max(axis=0) / limits.acceleration),
        read_only(np.abs(motion.dddq).max(axis=0) / limits.jerk),
        float((motion.tool_speed / trajectory.tool_speed_limit[leg]).max()),
        *((0.0, 0.0) if reading is None else _reading_shares(trajectory, t, reading)),
    )


def _reading_shares(trajectory: Trajectory, t: Array, reading: ReadingLimits) -> tuple[float, float]:
    """Largest rate and acceleration of the reading at times t (n,) [s], as shares of their limits."""
    step = 1e-4  # [s] between the readings whose differences are its rate and acceleration
    before, here, after = (reading.length(trajectory.angles(t + k * step)) for k in (-1, 0, 1))
    rate = np.abs(after - before).max() / (2.0 * step)
    acceleration = np.abs(after - 2.0 * here + before).max() / step**2
    return float(rate / reading.rate), float(acceleration / reading.acceleration)


TABLE_DECIMALS = 6  # of s, degrees and mm: 1 µs, 1e-6 degree, 1 nm


def trajectory_table(
    trajectory: Trajectory, dt: float, length: Callable[[Array], Array], joints: Sequence[str] = ()
) -> pl.DataFrame:
    """Return t_s, q1_deg … qN_deg, length_mm every ``dt`` [s] and at the end, rounded to DECIMALS.

    ``length`` maps joint angles (n, N) [rad] to the gauge's reading (n,) [m]; ``joints`` are the names of the joints'
    columns where one slides.
    """
    motion = trajectory.sample(dt)
    columns = {"t_s": motion.t}
    names = joints or [f"q{j + 1}_deg" for j in range(motion.q.shape[1])]
    columns |= dict(zip(names, to_deg(motion.q.T), strict=True))
    columns["length_mm"] = to_mm(length(motion.q))
    return pl.DataFrame({name: np.round(value, TABLE_DECIMALS) + 0.0 for name, value in columns.items()})


def trajectory_csv(frame: pl.DataFrame) -> str:
    """Return the rows as CSV with DECIMALS decimals throughout: the same bytes on any machine."""
    return frame.write_csv(float_precision=TABLE_DECIMALS)
