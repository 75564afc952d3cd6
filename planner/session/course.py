"""What the robot drives for one fixture, blended, timed and proven by both collision engines.

A course is made from waypoints and blend radii alone, so a program exported later from ``plan.json`` is the same."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.units import Array, read_only
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import ProvenPath, SeparateMotions, Verdict, judge_path
from planner.motion.timing.limits import Limits
from planner.motion.timing.trajectory import Trajectory, blend_corners, plan_trajectory

DIGITS = 9  # of degrees and millimetres in plan.json


@dataclass(frozen=True)
class Waypoints:
    """A path to be driven: q (m, N) [rad], id of the pose or −1 (m,), blend radius (m,) [m], 0 where it rests."""

    q: Array
    visit: np.ndarray
    blend: Array

    def reversed(self) -> "Waypoints":
        """Return the path driven from its end to its beginning."""
        return Waypoints(self.q[::-1], self.visit[::-1], self.blend[::-1])

    def there_and_back(self) -> "Waypoints":
        """Return the path driven forward and then backward."""
        parts = ((a, a[-2::-1]) for a in (self.q, self.visit, self.blend))
        return Waypoints(*(np.concatenate(p) for p in parts))


@dataclass(frozen=True)
class Course:
    """All that a program needs for one fixture; ``measuring`` is the whole drive, both ways where asked."""

    fixture: int
    travel: Waypoints
    travel_trajectory: Trajectory
    measuring: Waypoints
    trajectory: Trajectory


def round_angles(angles: Array) -> Array:
    """Round angles [rad] to what ``plan.json`` keeps of them, so that reading it back gives the same bits."""
    return read_only(np.deg2rad(np.round(np.rad2deg(angles), DIGITS)))


def axis_limits(cell: Cell, bar: bool) -> Limits:
    """Axis limits; where the robot does not measure on the way, its speed is the allowed part of full speed."""
    robot = cell.robot
    slow = 1.0 if bar and is_continuous(cell) else cell.motion.travel
    return Limits(robot.speed * slow, robot.acceleration, robot.jerk)


def tool_speed(cell: Cell, bar: bool) -> float:
    """Limit of the tool point's speed [m/s]: the measuring speed where the gauge is read while moving, else none."""
    return cell.motion.tool_speed if bar and is_continuous(cell) else np.inf


def leg_speed(cell: Cell, visit: np.ndarray, bar: bool) -> float | Array:
    """Limit of the tool point's speed on the legs of a path with visits (m,), one for all or (m − 1,) [m/s].

    The last way to a ball, and the first away from it, are driven at the measuring speed: the indicators touch there.
    """
    if not bar or cell.gauge.head is None:
        return tool_speed(cell, bar)
    at_ball = visit >= 0
    return np.where(at_ball[:-1] | at_ball[1:], cell.motion.tool_speed, np.inf)


def is_continuous(cell: Cell) -> bool:
    """Whether the gauge is read while moving."""
    return cell.motion.measure == "continuous"


def time_course(cell: Cell, fixture: int, travel: Waypoints, measuring: Waypoints) -> Course:
    """Time the way to the mount pose and the measuring path (given one way)."""
    cell = cell.at(fixture)
    moving = is_continuous(cell)
    if moving and cell.motion.both_ways:
        measuring = measuring.there_and_back()
    rest = 0.0 if moving else cell.motion.settle + cell.motion.dwell
    if cell.gauge.head is not None:
        rest += cell.gauge.head.seconds
    dwell = np.where(measuring.visit >= 0, rest, 0.0) * (measuring.blend == 0)
    return Course(
        fixture,
        travel,
        _time_waypoints(cell, travel, np.zeros(len(travel.q)), bar=False),
        measuring,
        _time_waypoints(cell, measuring, dwell, bar=True),
    )


def _time_waypoints(cell: Cell, path: Waypoints, dwell: Array, bar: bool) -> Trajectory:
    return plan_trajectory(
        path.q,
        stop=path.blend == 0,
        blend_m=path.blend,
        tool_position=cell.map_position,
        tool_jacobian=cell.map_jacobian,
        limits=axis_limits(cell, bar),
        tool_speed=leg_speed(cell, path.visit, bar),
        dwell=dwell,
    )


HALVINGS = 4  # of a blend that does not fit, before it becomes a stop
BLEND_ROOM = 5e-5  # [m] beyond the clearance for blends: the two engines' distances differ by 1e-5
STOPPED = 4  # times that blends which a judge does not prove become stops


def release_path(
    with_bar: Constraints,
    without_bar: Constraints,
    way: Waypoints,
    measuring: Waypoints,
    apart: Sequence[SeparateMotions] = (),
) -> tuple[Course, tuple[Verdict, ...]]:
    """Time both paths and have both engines judge them; a blend that either does not prove becomes a stop.

    Motions of the measuring path that are ``apart`` keep constraints of their own.

    Raises:
        NoSolutionError: an engine does not prove the path; nothing is written for it.
    """
    for _ in range(STOPPED + 1):
        driven = time_course(with_bar.cell, with_bar.workspace.fixture, way, measuring)
        first, lost = _judge_blended(with_bar, measuring, driven.trajectory, apart)
        second, lost_way = _judge_blended(without_bar, way, driven.travel_trajectory)
        measuring, way = _stop_at(measuring, lost), _stop_at(way, lost_way)
        if not len(lost) and not len(lost_way):
            break
    for v in first + second:
        if not v.clear:
            raise NoSolutionError(
                f"path: {v.engine} does not prove {len(v.failures)} of its motions and blends "
                f"({'; '.join(v.failures[:3])}): raise motion.clearance_mm a little, or try another --seed"
            )
    return driven, first + second


def _judge_blended(
    constraints: Constraints, path: Waypoints, trajectory: Trajectory, apart: Sequence[SeparateMotions] = ()
) -> tuple[tuple[Verdict, ...], np.ndarray]:
    """Both engines' verdicts on the legs and on the triangle under every blend (the way back has the same).

    Returned beside them: the path points whose blends an engine does not prove.
    """
    count = len(path.q)
    corner = np.flatnonzero(~trajectory.stop[:count])
    triangles = np.stack([trajectory.entry[corner], path.q[corner], trajectory.exit[corner]], axis=1)
    verdicts = judge_path(constraints, path.q, triangles, apart)
    lost = np.unique([k - (count - 1) for v in verdicts for k in v.unproven if k >= count - 1]).astype(int)
    return verdicts, corner[lost]


def _stop_at(path: Waypoints, points: np.ndarray) -> Waypoints:
    """Let the robot stop at some path points."""
    blend = path.blend.copy()
    blend[points] = 0.0
    return replace(path, blend=blend)


def add_blends(cell: Cell, constraints: Constraints, path: ProvenPath, stop: np.ndarray, ids: np.ndarray) -> Waypoints:
    """Return a path with the blends that fit, none where it stops; ids (m,) of the poses, −1 at supports."""
    rest = stop.copy()
    rest[[0, -1]] = True
    return Waypoints(path.q, ids, np.round(fit_blends(cell, constraints, path.q, rest), 12))


def fit_blends(cell: Cell, constraints: Constraints, q: Array, stop: np.ndarray) -> Array:
    """Largest blend radius at each path point, (m,) [m], whose whole corner is proven to keep every constraint.

    A blend that does not fit is halved; after some halvings the corner becomes a stop (radius 0).
    """
    blend, wide = np.where(stop, 0.0, cell.motion.blend), constraints.with_room(BLEND_ROOM)
    for attempt in range(HALVINGS + 1):
        entry, leave, at_rest = blend_corners(
            q,
            stop=stop | (blend == 0),
            blend_m=blend,
            tool_position=cell.map_position,
            limits=axis_limits(cell, constraints.bar),
            tool_speed=tool_speed(cell, constraints.bar),
        )
        corner = np.flatnonzero(~at_rest)
        if not len(corner):
            break
        proof = wide.prove_triangles(entry[corner], q[corner], leave[corner])
        failed = corner[~proof.proven]
        if not len(failed):
            break
        blend[failed] = blend[failed] / 2 if attempt < HALVINGS else 0.0
    return blend
