"""Blends that fit, and the release of a path: timed, and proven by both collision engines with every blend in it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.errors import NoSolutionError
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import ProvenPath, SeparateMotions, Verdict, judge_path
from planner.motion.timing.trajectory import Trajectory, blend_corners
from planner.session.course import TimedPath, Waypoints, axis_limits, time_path, tool_speed

HALVINGS = 4  # of a blend that does not fit, before it becomes a stop
BLEND_ROOM = 5e-5  # [m] beyond the clearance for blends: the two engines' distances differ by 1e-5
STOPPED = 4  # times that blends which a judge does not prove become stops


@dataclass(frozen=True)
class ReleasedPath:
    """A timed path and the verdicts of both collision engines, which prove it."""

    path: TimedPath
    verdicts: tuple[Verdict, ...]


def release_path(
    constraints: Constraints,
    points: Waypoints,
    timing: Callable[[Waypoints], TimedPath] | None = None,
    separate: Sequence[SeparateMotions] = (),
) -> ReleasedPath:
    """Time a path and have both engines judge it; a blend that either does not prove becomes a stop.

    Args:
        constraints: what every motion keeps.
        points: the path, one way.
        timing: how it is timed; by default as a way on which nothing is measured.
        separate: motions that keep constraints of their own.

    Raises:
        NoSolutionError: an engine does not prove the path; nothing is written for it.
    """
    for _ in range(STOPPED + 1):
        timed = _time_way(constraints, points) if timing is None else timing(points)
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


def _time_way(constraints: Constraints, points: Waypoints) -> TimedPath:
    return time_path(constraints.cell, points, constraints.workspace.mounting, constraints.bar)


def judge_corners(
    constraints: Constraints, q: Array, trajectory: Trajectory, separate: Sequence[SeparateMotions] = ()
) -> tuple[tuple[Verdict, ...], np.ndarray]:
    """Both engines' verdicts on the legs of a path q (m, N) [rad] and on the triangle under every blend.

    A trajectory that is driven both ways has the same blends on the way back. Returned beside the verdicts: the path
    points whose blends an engine does not prove.
    """
    count = len(q)
    corner = np.flatnonzero(~trajectory.stop[:count])
    triangles = np.stack([trajectory.entry[corner], q[corner], trajectory.exit[corner]], axis=1)
    verdicts = judge_path(constraints, q, triangles, separate)
    unproven = np.unique([k - (count - 1) for v in verdicts for k in v.unproven if k >= count - 1]).astype(int)
    return verdicts, corner[unproven]


def release_way(constraints: Constraints, path: ProvenPath) -> ReleasedPath:
    """Release a way on which nothing is measured, blended wherever that fits."""
    points = add_blends(constraints, path, np.zeros(len(path.q), dtype=bool), np.full(len(path.q), -1))
    return release_path(constraints, points)


def add_blends(constraints: Constraints, path: ProvenPath, stop: np.ndarray, ids: np.ndarray) -> Waypoints:
    """Return a path with the blends that fit, none where it stops; ids (m,) of the poses, −1 at supports."""
    rest = stop.copy()
    rest[[0, -1]] = True
    return Waypoints(path.q, ids, np.round(fit_blends(constraints, path.q, rest), 12))


def fit_blends(constraints: Constraints, q: Array, stop: np.ndarray) -> Array:
    """Largest blend radius at each path point, (m,) [m], whose whole corner is proven to keep every constraint.

    A blend that does not fit is halved; after some halvings the corner becomes a stop (radius 0).
    """
    cell = constraints.cell
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
