"""Holds a plan against the cell beside it: a program must not be written from two that do not belong together."""

from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.schema import read_json, validate
from planner.common.units import Array
from planner.session.course import Course
from planner.session.plan_file import PartialModel, PlanFile

LENGTH_MM, ANGLE_DEG, DURATION = 1e-3, 1e-6, 1e-4


class MeasuredPose(PartialModel):
    """A pose with the bar length that was planned for it."""

    id: int
    q_deg: tuple[float, ...]
    length_mm: float | None = None
    fixture: str = ""
    point: str = ""
    ball: str | None = None


class PlannedDuration(PartialModel):
    """How long the whole session takes."""

    duration_s: float


class PlannedFor(PartialModel):
    """What ``plan.json`` says of the robot and the cell that it was planned for."""

    robot: str
    poses: tuple[MeasuredPose, ...]
    trajectory: PlannedDuration


def place_names(cell: Cell) -> list[tuple[str, str]]:
    """Return the names of fixture and tool point of each place of the bar, as ``plan.json`` gives them."""
    return [(f.name, cell.point_name(k)) for k, f in enumerate(cell.fixtures)]


def check_robot(path: Path, beside: Path, cell: Cell, plan: PlanFile) -> PlannedFor:
    """Hold robot and fixtures of the plan at ``path`` against the cell, before anything is made of both.

    Raises:
        InputError: another robot, or other fixtures.
    """
    found = validate(read_json(path), PlannedFor, str(path))
    if found.robot != cell.robot.name:
        raise InputError(
            f"{path} is a plan for {found.robot}, but {beside} is a cell of {cell.robot.name}: "
            "put the cell.toml that was written with the plan beside it"
        )
    driven, there = [(d.fixture, d.point) for d in plan.drives], place_names(cell)
    if driven != there:
        said, has = (", ".join(" at ".join(filter(None, pair)) for pair in pairs) for pairs in (driven, there))
        raise InputError(
            f"{path} drives the fixtures {said}, but {beside} has {has}: "
            "put the cell.toml that was written with the plan beside it"
        )
    return found


def check_courses(path: Path, beside: Path, cell: Cell, plan: PlannedFor, courses: list[Course]) -> None:
    """Hold home, bar lengths and duration against what the cell makes of the plan's poses.

    Raises:
        InputError: tool, fixture, home, robot or motion is not that of the plan.
    """
    start = np.abs(np.rad2deg(courses[0].travel.q[0] - cell.home)).max()
    if start > ANGLE_DEG:
        raise _mismatch(path, beside, f"home is {start:.4g} deg away from where the plan starts")
    off = _length_errors(cell, plan) if cell.gauge.is_attached else _centring_errors(cell, plan)
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) > LENGTH_MM:
        pose = plan.poses[worst].id
        how = f"the bar at pose {pose} would be {off[worst]:+.3f} mm longer than planned"
        raise _mismatch(
            path, beside, how if cell.gauge.is_attached else f"pose {pose} is {off[worst]:.3f} mm off its ball"
        )
    seconds = sum(c.trajectory.duration_s for c in courses)
    if abs(seconds / plan.trajectory.duration_s - 1.0) > DURATION:
        planned = plan.trajectory.duration_s
        raise _mismatch(path, beside, f"measuring would take {seconds:.2f} s, planned are {planned:.2f} s")


def _length_errors(cell: Cell, plan: PlannedFor) -> Array:
    """Bar length by the cell less that of the plan, one a pose [mm]."""
    q, there = np.deg2rad([p.q_deg for p in plan.poses]), place_names(cell)
    where = np.array([there.index((p.fixture, p.point)) for p in plan.poses])
    length = np.zeros(len(q))
    for k in range(len(cell.fixtures)):
        length[where == k] = cell.bar_length(q[where == k], k)
    return np.asarray(length * 1e3 - [p.length_mm or 0.0 for p in plan.poses])


def _centring_errors(cell: Cell, plan: PlannedFor) -> Array:
    """Distance of the tool point from the ball that is centred there, one a pose [mm]; nothing is off elsewhere."""
    names = [b.name for b in cell.balls]
    x = cell.map_position(np.deg2rad([p.q_deg for p in plan.poses]))
    ball = [names.index(p.ball) if p.ball in names else -1 for p in plan.poses]
    off = [0.0 if k < 0 else float(np.linalg.norm(x[i] - cell.p_BS[k])) * 1e3 for i, k in enumerate(ball)]
    return np.array(off)


def _mismatch(path: Path, beside: Path, because: str) -> InputError:
    return InputError(
        f"{beside} is not the cell of {path}: {because}; "
        "use the cell.toml that was written with the plan, or plan again"
    )
