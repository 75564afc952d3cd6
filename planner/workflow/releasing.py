"""Blends that fit, and the release of a path: timed, and proven by both engines with every blend in it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.errors import NoSolutionError
from planner.path import Apart, Constraints, Path, Verdict, judge
from planner.plan import Course, Waypoints, axis_limits, course, tool_speed
from planner.trajectory import Trajectory, blend_corners
from planner.units import Array

HALVINGS = 4  # of a blend that does not fit, before it becomes a stop
BLEND_ROOM = 5e-5  # [m] beyond the clearance for blends: the two engines' distances differ by 1e-5
STOPPED = 4  # times that blends which a judge does not prove become stops


def released(
    with_bar: Constraints,
    without_bar: Constraints,
    way: Waypoints,
    measuring: Waypoints,
    apart: Sequence[Apart] = (),
) -> tuple[Course, tuple[Verdict, ...]]:
    """Time both paths and have both engines judge them; a blend that either does not prove becomes a stop.

    Motions of the measuring path that are ``apart`` keep constraints of their own.

    Raises:
        NoSolutionError: an engine does not prove the path; nothing is written for it.
    """
    for _ in range(STOPPED + 1):
        driven = course(with_bar.cell, with_bar.workspace.fixture, way, measuring)
        first, lost = _judged(with_bar, measuring, driven.trajectory, apart)
        second, lost_way = _judged(without_bar, way, driven.travel_trajectory)
        measuring, way = _without_blends(measuring, lost), _without_blends(way, lost_way)
        if not len(lost) and not len(lost_way):
            break
    for v in first + second:
        if not v.clear:
            raise NoSolutionError(
                f"path: {v.engine} does not prove {len(v.failures)} of its motions and blends "
                f"({'; '.join(v.failures[:3])}): raise motion.clearance_mm a little, or try another --seed"
            )
    return driven, first + second


def _judged(
    constraints: Constraints, path: Waypoints, trajectory: Trajectory, apart: Sequence[Apart] = ()
) -> tuple[tuple[Verdict, ...], np.ndarray]:
    """Both engines' verdicts on the legs and on the triangle under every blend (the way back has the same).

    Returned beside them: the path points whose blends an engine does not prove.
    """
    count = len(path.q)
    corner = np.flatnonzero(~trajectory.stop[:count])
    triangles = np.stack([trajectory.entry[corner], path.q[corner], trajectory.exit[corner]], axis=1)
    verdicts = judge(constraints, path.q, triangles, apart)
    lost = np.unique([k - (count - 1) for v in verdicts for k in v.unproven if k >= count - 1]).astype(int)
    return verdicts, corner[lost]


def _without_blends(path: Waypoints, points: np.ndarray) -> Waypoints:
    """Let the robot stop at some path points."""
    blend = path.blend.copy()
    blend[points] = 0.0
    return replace(path, blend=blend)


def blended(cell: Cell, constraints: Constraints, path: Path, stop: np.ndarray, ids: np.ndarray) -> Waypoints:
    """Return a path with the blends that fit, none where it stops; ids (m,) of the poses, −1 at supports."""
    rest = stop.copy()
    rest[[0, -1]] = True
    return Waypoints(path.q, ids, np.round(fitting_blends(cell, constraints, path.q, rest), 12))


def fitting_blends(cell: Cell, constraints: Constraints, q: Array, stop: np.ndarray) -> Array:
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
