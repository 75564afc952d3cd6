"""A way between circles, or to the first: blended where that is proven, timed, and judged by both engines."""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.errors import NoSolutionError
from planner.path import Constraints, Path, Verdict, judge
from planner.plan import Waypoints, axis_limits, tool_speed
from planner.trajectory import Trajectory, plan_trajectory
from planner.workflow.releasing import blended


@dataclass(frozen=True)
class Way:
    """A path with its blends, in time, and what both engines say of it."""

    points: Waypoints
    trajectory: Trajectory
    verdicts: tuple[Verdict, ...]


def proven_way(constraints: Constraints, path: Path) -> Way:
    """Blend, time and judge a path; blends that an engine does not prove become stops.

    Raises:
        NoSolutionError: an engine does not prove the path at all.
    """
    none = np.zeros(len(path.q), dtype=bool)
    points = blended(constraints.cell, constraints, path, none, np.full(len(path.q), -1))
    for attempt in (points, replace(points, blend=np.zeros(len(path.q)))):
        way = _judged(constraints, attempt)
        if all(v.clear for v in way.verdicts):
            return way
    bad = [f"{v.engine}: {f}" for v in way.verdicts for f in v.failures]
    raise NoSolutionError(f"path: {bad[0]} is not proven: raise motion.clearance_mm a little, or try another --seed")


def _judged(constraints: Constraints, points: Waypoints) -> Way:
    trajectory = timed_way(constraints.cell, points, constraints.bar)
    corner = np.flatnonzero(~trajectory.stop)
    triangles = np.stack([trajectory.entry[corner], points.q[corner], trajectory.exit[corner]], axis=1)
    return Way(points, trajectory, judge(constraints, points.q, triangles))


def timed_way(cell: Cell, points: Waypoints, bar: bool) -> Trajectory:
    """Time a way with or without the bar."""
    return plan_trajectory(
        points.q,
        stop=points.blend == 0,
        blend_m=points.blend,
        tool_position=cell.map_position,
        tool_jacobian=cell.map_jacobian,
        limits=axis_limits(cell, bar),
        tool_speed=tool_speed(cell, bar),
    )
