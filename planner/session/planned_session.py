"""A plan with the cell that it was made for: what a program or a simulated run is made of, now or later."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import read_cell
from planner.common.errors import InputError
from planner.session.course import Course, Waypoints, time_course
from planner.session.document import DriveRecord, PlanDocument, WaypointRecord, read_plan, read_waypoints
from planner.session.plan_record import plan_document
from planner.session.plan_types import Plan
from planner.session.trust import check_trust, doubts

LENGTH_MM, ANGLE_DEG, DURATION = 1e-3, 1e-6, 1e-4


@dataclass(frozen=True)
class PlannedSession:
    """A session that is planned: its cell, its document, and what is driven, one course a fixture."""

    cell: Cell
    document: PlanDocument
    courses: tuple[Course, ...]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, plan: Plan) -> "PlannedSession":
        """Return the session of a plan in memory."""
        return cls(plan.cell, plan_document(plan), plan.courses)

    @property
    def plan_id(self) -> str:
        """Id of the plan."""
        return self.document.plan_id


def load_session(path: Path, purpose: str, check: bool = False) -> PlannedSession:
    """Read the plan at ``path`` with the cell beside it.

    Args:
        path: of ``plan.json``.
        purpose: what is done with it, for messages.
        check: whether cell and plan must agree in every length and duration, as a program needs it.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together.
    """
    document = read_plan(path, "drives", *(("robot", "poses", "trajectory") if check else ()))
    beside, cell = read_cell_beside(path, purpose)
    if check:
        _check_robot(path, beside, cell, document)
    courses = tuple(
        time_course(
            cell,
            mounting,
            _joint_path(path, cell, d.travel),
            _joint_path(path, cell, d.waypoints),
            _check_shortcuts(path, d),
        )
        for mounting, d in zip(cell.mountings_of(document.drives, path), document.drives, strict=True)
    )
    if check:
        _check_courses(path, beside, cell, document, courses)
    notes = check_trust(path, cell, courses) if check else doubts(path, cell)
    return PlannedSession(cell, document, courses, notes)


def _check_shortcuts(path: Path, drive: DriveRecord) -> tuple[int, ...]:
    beyond = [k for k in drive.shortcuts if k >= len(drive.waypoints)]
    if beyond:
        raise InputError(
            f"{path}: a drive has the shortcut {beyond[0]}, allowed are its {len(drive.waypoints)} waypoints"
        )
    return drive.shortcuts


def read_cell_beside(path: Path, purpose: str) -> tuple[Path, Cell]:
    """Return the cell beside the plan at ``path``, and its file.

    Raises:
        InputError: it is not there, or wrong.
    """
    beside = path.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a plan is {purpose} together with the cell that was planned")
    return beside, read_cell(beside, "cell")


def _joint_path(path: Path, cell: Cell, points: tuple[WaypointRecord, ...]) -> Waypoints:
    wrong = [len(p.q_deg) for p in points if len(p.q_deg) != cell.robot.n_joints]
    if wrong or len(points) < 2:
        found = f"{wrong[0]} angles" if wrong else f"{len(points)} waypoints"
        raise InputError(
            f"{path}: a drive has {found}; {cell.robot.name} needs {cell.robot.n_joints} angles and two waypoints"
        )
    return read_waypoints(points)


def _check_robot(path: Path, beside: Path, cell: Cell, plan: PlanDocument) -> None:
    """Hold robot and fixtures of the plan at ``path`` against the cell, before anything is made of both."""
    if plan.robot != cell.robot.name:
        raise InputError(
            f"{path} is a plan for {plan.robot}, but {beside} is a cell of {cell.robot.name}: "
            "put the cell.toml that was written with the plan beside it"
        )
    driven, there = [(d.fixture, d.point) for d in plan.drives], [cell.names_of(m) for m in cell.mountings]
    if driven != there:
        said, has = (", ".join(" at ".join(filter(None, pair)) for pair in pairs) for pairs in (driven, there))
        raise InputError(
            f"{path} drives the fixtures {said}, but {beside} has {has}: "
            "put the cell.toml that was written with the plan beside it"
        )


def _check_courses(path: Path, beside: Path, cell: Cell, plan: PlanDocument, courses: Sequence[Course]) -> None:
    """Hold home, bar lengths and duration against what the cell makes of the plan's poses."""
    assert plan.trajectory is not None
    start = np.abs(np.rad2deg(courses[0].travel.q[0] - cell.home)).max()
    if start > ANGLE_DEG:
        raise _mismatch(path, beside, f"home is {start:.4g} deg away from where the plan starts")
    off = cell.gauge.plan_errors(cell, plan.poses, path)
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) > LENGTH_MM:
        raise _mismatch(path, beside, cell.gauge.plan_error_text(plan.poses[worst].id, float(off[worst])))
    seconds = sum(c.trajectory.duration_s for c in courses)
    if abs(seconds / plan.trajectory.duration_s - 1.0) > DURATION:
        planned = plan.trajectory.duration_s
        raise _mismatch(path, beside, f"measuring would take {seconds:.2f} s, planned are {planned:.2f} s")


def _mismatch(path: Path, beside: Path, because: str) -> InputError:
    return InputError(
        f"{path} and {beside} do not belong together: {because}; "
        "one of them was changed after planning; use both as they were written, or plan again"
    )
