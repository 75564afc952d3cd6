"""``edbb export``: a program in any dialect, later, from ``plan.json`` and the cell beside it."""

from pathlib import Path

import numpy as np

from planner.cell import Cell
from planner.cell.reading import read_cell
from planner.circular import is_circular
from planner.errors import InputError
from planner.plan import Course, DriveFile, WaypointFile, Waypoints, course, read_plan, settled
from planner.program import ProgramFile, info, write_program
from planner.repeatable import single_threaded
from planner.workflow.belonging import check_courses, check_robot, places_of
from planner.workflow.circle_reading import export_circles
from planner.workflow.session import session


@single_threaded
def export_plan(path: Path, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write the program of the plan at ``path`` in ``dialect``; ``stem`` is the wanted file name, ``-`` for none.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together; an unknown dialect.
    """
    if is_circular(path):
        return export_circles(path, dialect, stem)
    chosen = info(dialect)
    file = read_plan(path)
    beside = path.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a plan is exported together with the cell that was planned")
    cell = read_cell(beside, "cell")
    planned_for = check_robot(path, beside, cell, file)
    courses = [_course(path, cell, d) for d in file.drives]
    check_courses(path, beside, cell, planned_for, courses)
    program = session(cell, courses, file.plan_id, chosen.wants_dense_path)
    name = f"{cell.robot.name}_{file.plan_id}" if stem == "-" else Path(stem).stem
    return write_program(program, dialect, name)


def _course(path: Path, cell: Cell, drive: DriveFile) -> Course:
    fixture = places_of(cell).index((drive.fixture, drive.point))
    return course(cell, fixture, _waypoints(path, cell, drive.travel), _waypoints(path, cell, drive.waypoints))


def _waypoints(path: Path, cell: Cell, points: tuple[WaypointFile, ...]) -> Waypoints:
    wrong = [len(p.q_deg) for p in points if len(p.q_deg) != cell.robot.n_joints]
    if wrong or len(points) < 2:
        found = f"{wrong[0]} angles" if wrong else f"{len(points)} waypoints"
        raise InputError(
            f"{path}: a drive has {found}; {cell.robot.name} needs {cell.robot.n_joints} angles and two waypoints"
        )
    return Waypoints(
        settled(np.deg2rad([p.q_deg for p in points])),
        np.array([p.visit for p in points]),
        np.round(np.array([p.blend_mm for p in points]) / 1e3, 12),
    )
