"""From the path of a tour to one that is driven: supports, ways to balls, blends; timed, and proven by both engines."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.errors import NoSolutionError
from planner.common.units import DEG, Array, read_only, round_angles
from planner.design.candidates.pool import PoseSet
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathLeg, ProvenPath, SeparateMotions, Verdict, judge_path
from planner.motion.timing.curve import corner_ends, distinct_points
from planner.motion.timing.leg_times import axis_limits, tool_speed
from planner.motion.timing.trajectory import Trajectory, blend_corners
from planner.session.driven_moves import corner_radii
from planner.session.plan_types import Role, TimedPath, Waypoints, motion_signs, time_path
from planner.session.tolerances import BLEND_MARGIN


@dataclass(frozen=True)
class ReleasedPath:
    """A timed path and the verdicts of both collision engines, which prove it."""

    path: TimedPath
    verdicts: tuple[Verdict, ...]


def release_path(
    constraints: Constraints,
    points: Waypoints,
    timing: Callable[[Waypoints], TimedPath],
    separate: Sequence[SeparateMotions] = (),
) -> ReleasedPath:
    """Time a path and have both engines judge it; a blend that either does not prove becomes a stop.

    Args:
        constraints: what every motion keeps.
        points: the path, one way.
        timing: how it is timed.
        separate: motions that keep constraints of their own.

    Raises:
        NoSolutionError: an engine does not prove the path; nothing is written for it.
    """
    for _ in range(4 + 1):  # times that blends which a judge does not prove become stops
        timed = timing(points)
        verdicts, unproven = judge_corners(constraints, points.q, timed.trajectory, separate)
        if not len(unproven):
            break
        blend = points.blend.copy()
        blend[unproven] = 0.0
        points = replace(points, blend=blend)
    for v in verdicts:
        if not v.clear:
            raise NoSolutionError(
                f"path: {v.engine} does not prove {len(v.failures)} of its motions and blends "
                f"({'; '.join(v.failures[:3])}): raise motion.clearance_mm a little, or try another --seed"
            )
    return ReleasedPath(timed, verdicts)


def judge_corners(
    constraints: Constraints, q: Array, trajectory: Trajectory, separate: Sequence[SeparateMotions] = ()
) -> tuple[tuple[Verdict, ...], np.ndarray]:
    """Both engines' verdicts on the legs of a path q (m, N) [rad] and on the triangle under every blend.

    A trajectory that is driven both ways has the same blends on the way back. Returned beside the verdicts: the path
    points whose blends an engine does not prove.
    """
    count, place = len(q), constraints.cell.map_position
    corner = np.flatnonzero(~trajectory.stop[:count])
    point = distinct_points(q)
    radius = corner_radii(constraints.cell, q, trajectory)[corner]
    first = np.searchsorted(point, np.arange(point[-1] + 1))
    entry, leave = corner_ends(q[first], point[corner], radius, place)
    triangles = np.stack([entry, q[corner], leave], axis=1)
    verdicts = judge_path(constraints, q, triangles, separate)
    unproven = np.unique([k - (count - 1) for v in verdicts for k in v.unproven if k >= count - 1]).astype(int)
    return verdicts, corner[unproven]


def release_travel(constraints: Constraints, path: ProvenPath) -> ReleasedPath:
    """Release a way on which nothing is measured, blended wherever that fits."""
    points = add_blends(constraints, path, np.zeros(len(path.q), dtype=bool), np.full(len(path.q), -1))
    cell, mounting = constraints.cell, constraints.workspace.mounting
    return release_path(constraints, points, lambda p: time_path(cell, p, mounting, constraints.bar))


def add_blends(constraints: Constraints, path: ProvenPath, stop: np.ndarray, ids: np.ndarray) -> Waypoints:
    """Return a path with the blends that fit, none where it stops; ids (m,) of the poses, −1 at supports."""
    rest = stop.copy()
    rest[[0, -1]] = True
    return Waypoints(path.q, ids, np.round(fit_blends(constraints, path.q, rest), 12))


def fit_blends(constraints: Constraints, q: Array, stop: np.ndarray) -> Array:
    """Largest blend radius at each path point, (m,) [m], whose whole corner is proven to keep every constraint.

    A blend that does not fit is halved; after some halvings the corner becomes a stop (radius 0).
    """
    halvings = 4  # of a blend that does not fit, before it becomes a stop
    cell = constraints.cell
    blend, wide = np.where(stop, 0.0, cell.motion.blend), constraints.with_room(BLEND_MARGIN)
    for attempt in range(halvings + 1):
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
        proof = wide.prove_corners(np.stack([entry[corner], q[corner], leave[corner]], axis=1))
        failed = corner[~proof.proven]
        if not len(failed):
            break
        blend[failed] = blend[failed] / 2 if attempt < halvings else 0.0
    return blend


@dataclass(frozen=True)
class TourStop:
    """A pose to be visited.

    Attributes:
        q: controller angles, (N,) [rad].
        role: what the pose is for.
        approach: wanted sign of each axis' last movement (N,), 0 where any will do.
        ball: which ball is centred there, or −1.
        back: where the ball is approached from, (N,) [rad].
        times: how often it is centred in a row.
        lap: in which lap of the tour it is visited, from 0 on.
    """

    q: Array
    role: Role
    approach: Array | None = None
    ball: int = -1
    back: Array | None = None
    times: int = 1
    lap: int = 0

    @property
    def node(self) -> Array:
        """Return where the tour passes, (N,) [rad]."""
        return self.q if self.back is None else self.back


def candidate_stop(pool: PoseSet, k: int, role: Role, times: int = 1) -> TourStop:
    """Return a candidate as a stop of a tour; ``times``: how often its ball is centred, where it has one."""
    if pool.ball is None or pool.back is None:
        return TourStop(pool.q[k], role)
    return TourStop(pool.q[k], role, ball=int(pool.ball[k]), back=pool.back[k], times=times)


def approach_from_sides(constraints: Constraints, path: ProvenPath, wanted: Array) -> ProvenPath:
    """Return a path that comes to its poses from the wanted sides, wherever it can.

    Args:
        constraints: what every motion keeps.
        path: of a tour.
        wanted: sign of each axis' last movement for every node of the path (n, N); where it is 0 any will do.
    """
    signs_wanted = np.where(path.node[:, None] >= 0, wanted[path.node], 0.0)
    other = ((motion_signs(path.q) != signs_wanted) & (signs_wanted != 0)).any(axis=1) & (path.node >= 0)
    at = np.flatnonzero(other)
    at = at[at > 0]
    before, pose, sign = path.q[at - 1], path.q[at], signs_wanted[at]
    past = np.full(pose.shape, np.nan)
    for reach in (3.0 * DEG, 1.5 * DEG, 0.75 * DEG):  # [rad] past the pose, the first that keeps every constraint
        left = np.flatnonzero(np.isnan(past[:, 0]))
        if not len(left):
            break
        way = np.clip(pose[left] - before[left], -reach, reach)
        tries = round_angles(pose[left] - np.where(sign[left] != 0, reach * sign[left], way))
        there, back = np.stack([before[left], tries], axis=1), np.stack([tries, pose[left]], axis=1)
        ok = constraints.prove_by_both_engines(there) & constraints.prove_by_both_engines(back)
        past[left[ok]] = tries[ok]
    reached = ~np.isnan(past[:, 0])
    longer = _insert_supports(path, at[reached], past[reached])
    first, second = judge_path(constraints, longer.q)
    return replace(longer, verdict=first, second=second) if first.clear and second.clear else path


def _insert_supports(path: ProvenPath, at: np.ndarray, past: Array) -> ProvenPath:
    """Put support poses (m, N) before the way points ``at`` (m,)."""
    q, node = np.insert(path.q, at, past, axis=0), np.insert(path.node, at, -1)
    node.setflags(write=False)
    places = np.flatnonzero(node >= 0)
    legs = [
        PathLeg(leg.start, leg.end, read_only(q[a + 1 : b]))
        for leg, a, b in zip(path.legs, places, places[1:], strict=False)
    ]
    return replace(path, q=read_only(q), node=node, legs=tuple(legs))


def insert_ball_approaches(path: ProvenPath, stops: Sequence[TourStop]) -> tuple[ProvenPath, np.ndarray]:
    """Insert the approach to each ball; return the path, and which of its points are approach poses, (m,) bool.

    Each node of the path is one of the ``stops``. At a ball the node is the ball's centre, not its approach pose.
    """
    q: list[Array] = []
    node: list[int] = []
    touched: list[bool] = []
    for point, k in zip(path.q, path.node.tolist(), strict=True):
        stop = stops[k] if k >= 0 else None
        if stop is None or stop.back is None:
            times = 1 if stop is None else stop.times
            q, node, touched = q + [point] * times, node + [k] * times, touched + [False] * times
            continue
        centre = round_angles(stop.q)
        q += [point, *[centre, point] * stop.times]
        node += [-1, *[k, -1] * stop.times]
        touched += [True, *[False, True] * stop.times]
    numbers = np.array(node)
    numbers.setflags(write=False)
    return replace(path, q=round_angles(np.array(q)), node=numbers), np.array(touched)


def separate_motions(away: Constraints, ball: Sequence[int]) -> list[SeparateMotions]:
    """The motions that begin or end at a ball, ball by ball; ``ball`` of every point of a path, −1 off the balls."""
    of_motion = np.maximum(ball[:-1], ball[1:])
    balls = np.unique(of_motion[of_motion >= 0]).tolist()
    return [SeparateMotions(away.at_ball(b), np.flatnonzero(of_motion == b)) for b in balls]
