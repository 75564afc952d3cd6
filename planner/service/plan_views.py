"""The view of a plan: the robot along its way, and all poses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, to_deg, to_mm
from planner.instruments.circular.document import is_circular, load_circular_plan
from planner.report.cell_view import ViewFrames, ViewPose, carrier_poses, compose_cell_view
from planner.service.views import SceneView, pack_scene
from planner.session.course import Course
from planner.session.document import read_plan
from planner.session.planned_session import load_session

FRAMES, PATH_POINTS = 360, 1500


def plan_view(path: Path) -> SceneView:
    """Return the view of the plan at ``path``: the robot along its way, and all poses."""
    session = load_circular_plan(path) if is_circular(path) else load_session(path, "shown")
    cell, courses = session.cell, session.courses
    count = max(2, FRAMES // len(courses))
    parts = [_frames(cell, c, count) for c in courses]
    frames = ViewFrames(np.vstack([p.poses for p in parts]), tuple(label for p in parts for label in p.labels))
    paths = tuple(_tool_path(cell, c) for c in courses)
    ways = tuple(to_mm(cell.at(c.mounting).map_position(c.travel.trajectory.sample(0.1).q)) for c in courses)
    return pack_scene(compose_cell_view(cell, frames, np.empty((0, 3)), paths, ways, _spots(cell, courses, path)))


def _frames(cell: Cell, course: Course, count: int) -> ViewFrames:
    trajectory = course.trajectory
    t = np.linspace(0.0, trajectory.duration_s, count)
    q = trajectory.at(t).q
    where = f"{cell.place_name(course.mounting)}   " if len(cell.mountings) > 1 else ""
    labels = tuple(
        f"{where}{int(s) // 60}:{int(s) % 60:02d} min   axes {'  '.join(f'{a:.1f}' for a in to_deg(angles))} deg"
        for s, angles in zip(t, q, strict=True)
    )
    return ViewFrames(carrier_poses(cell, course.mounting, q), labels)


def _tool_path(cell: Cell, course: Course) -> Array:
    q = course.trajectory.at(np.linspace(0.0, course.trajectory.duration_s, PATH_POINTS)).q
    return np.asarray(to_mm(cell.at(course.mounting).map_position(q)))


def _spots(cell: Cell, courses: Sequence[Course], path: Path) -> tuple[ViewPose, ...]:
    if is_circular(path):
        return ()
    roles = {p.id: p.role for p in read_plan(path, "poses").poses}
    spots = dict[int, ViewPose]()
    for c in courses:
        way = c.measuring
        for q, visit in zip(way.q, way.visit, strict=True):
            if visit >= 0 and int(visit) not in spots:
                role = roles.get(int(visit), "mount")
                position = to_mm(cell.at(c.mounting).map_position(q[None])[0])
                spots[int(visit)] = ViewPose(position, role, f"pose {int(visit)}, {role}")
    return tuple(spots.values())
