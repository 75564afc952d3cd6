"""A plan with its cell, what programs and simulated runs are made of, and whether its proofs hold there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import read_cell
from planner.common.content_hashes import name_parts
from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.common.result_folder import changed_files
from planner.common.schema import read_json
from planner.session.document import DriveRecord, PlanDocument, WaypointRecord, read_plan, read_waypoints
from planner.session.plan_record import changed_plan_parts, content_hash, plan_document
from planner.session.plan_types import Course, Plan, Waypoints, time_course
from planner.session.tolerances import CHANGED_ANGLE_DEG, CHANGED_DURATION, CHANGED_LENGTH_MM, SAME_ANGLE

NOT_HASHED = ("schema", "kind", "plan_id", "programs", "notes", "hashes")
PLAN, CELL = "plan.json", "cell.toml"
NEEDED = (".json", ".toml", ".urdf", ".stl", ".obj", ".dae", ".ply")  # of a plan's files what a program is made of


def integrity_notes(path: Path, cell: Cell) -> tuple[str, ...]:
    """Say why a plan is not known to be as it was written."""
    because = _why_not(path, cell)
    return () if because is None else (f"{path} is not as it was planned: {because}",)


def _why_not(path: Path, cell: Cell) -> str | None:
    """Say why a plan is not known to be as it was written; nothing where it is."""
    content = _content(path)
    said = {k: v for k, v in content.items() if k not in NOT_HASHED}
    if parts := changed_plan_parts(content, cell):
        return (
            f"changed since it was planned: {name_parts(parts)}; "
            "the index, the clearance and whatever else it states were those of the plan as it was written"
        )
    if content_hash(said, cell) != content.get("plan_id"):
        return "plan.json or cell.toml was changed, or another version wrote it"
    changed = changed_files(path.parent, path.name)
    needed = [f for f in changed or () if Path(f).suffix.lower() in NEEDED]
    if needed:
        return f"{needed[0]} was changed"
    shipped = cell.robot.path.is_relative_to(data_folder("robots")) and not any(b.mesh for b in cell.obstacles)
    return None if shipped or changed is not None else "no manifest.json tells whether robot and meshes are the same"


def _content(path: Path) -> dict[str, object]:
    content = read_json(path)
    assert isinstance(content, dict)
    return content


def check_continuity(path: Path, cell: Cell, courses: Sequence[Course]) -> None:
    """Refuse a plan one of whose paths does not begin where the one before ends, from home to where it turns back.

    Raises:
        InputError: naming the fixture and the joint.
    """
    for course in courses:
        ends = [("home", cell.home), ("the path to the first pose", course.travel.q[-1])]
        ends += [(f"'{p.heading}'", p.path.q[-1]) for p in course.passes]
        begins = [course.travel.q[0], *(p.path.q[0] for p in course.passes), course.travel.q[-1]]
        for (name, end), begin in zip(ends, begins, strict=True):
            off = np.abs(end - begin)
            j = int(off.argmax())
            if not off[j] <= SAME_ANGLE:
                ends_at, begins_at = (cell.robot.joint_text(j, q[j]) for q in (end, begin))
                raise InputError(
                    f"{path}: the drive at fixture {cell.place_name(course.mounting)} does not join: {name} ends with "
                    f"joint {j + 1} at {ends_at}, what follows begins at {begins_at}; "
                    "one of them was changed after planning; use the plan as it was written, or plan again"
                )


OWN_CELL = "put the cell.toml that was written with the plan beside it"


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
        """Id of the plan, the hash of its content."""
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
    _check_visits(path, cell, document)
    if check:
        _check_courses(path, beside, cell, document, courses)
        check_continuity(path, cell, courses)
    return PlannedSession(cell, document, courses, integrity_notes(path, cell))


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


def _check_visits(path: Path, cell: Cell, plan: PlanDocument) -> None:
    """Refuse a plan whose list of poses and whose paths say different angles, or that drives to no pose or past one."""
    starts = {(d.fixture, d.point): d.waypoints[0].q_deg for d in plan.drives}
    driven = [(w.visit, w.q_deg) for d in plan.drives for w in d.waypoints if w.visit >= 0]
    places = [(p.id, (p.fixture, p.point)) for p in plan.poses if p.role == "mount"]
    driven += [(k, starts[place]) for k, place in places if place in starts]
    listed = {p.id: p.q_deg for p in plan.poses}
    because = "one of them was changed after planning; use the plan as it was written, or plan again"
    if len(listed) != len(plan.poses):
        raise InputError(f"{path}: 'poses' has {len(plan.poses)} poses with {len(listed)} ids; {because}")
    if one_sided := sorted({k for k, _ in driven} ^ listed.keys()):
        k = one_sided[0]
        found = "is in 'poses', but no drive goes there" if k in listed else "is driven, but 'poses' does not have it"
        raise InputError(f"{path}: pose {k} {found}; {because}")
    passed = {w.q_deg for d in plan.drives for w in d.waypoints}
    if elsewhere := [s.after for s in plan.supports if s.q_deg not in passed]:
        raise InputError(f"{path}: no drive goes to the support pose after pose {elsewhere[0]}; {because}")
    for k, q_deg in driven:
        if len(listed[k]) != len(q_deg):
            raise InputError(f"{path}: pose {k} has {len(listed[k])} angles; {cell.robot.name} has {len(q_deg)}")
        off = np.abs(np.subtract(listed[k], q_deg))
        if off.max() > CHANGED_ANGLE_DEG:
            j = int(off.argmax())
            unit = cell.robot.joint_units[j]
            said, goes = f"{listed[k][j]:.4g} {unit} in 'poses'", f"{q_deg[j]:.4g} {unit} ('drives')"
            raise InputError(f"{path}: pose {k} has joint {j + 1} at {said}, but is driven to {goes}; {because}")


def _check_robot(path: Path, beside: Path, cell: Cell, plan: PlanDocument) -> None:
    """Hold robot and fixtures of the plan at ``path`` against the cell, before anything is made of both."""
    if plan.robot != cell.robot.name:
        raise InputError(f"{path} is a plan for {plan.robot}, but {beside} is a cell of {cell.robot.name}: {OWN_CELL}")
    driven, there = [(d.fixture, d.point) for d in plan.drives], [cell.names_of(m) for m in cell.mountings]
    if driven != there:
        said, has = (", ".join(" at ".join(filter(None, pair)) for pair in pairs) for pairs in (driven, there))
        raise InputError(f"{path} drives the fixtures {said}, but {beside} has {has}: {OWN_CELL}")


def _check_courses(path: Path, beside: Path, cell: Cell, plan: PlanDocument, courses: Sequence[Course]) -> None:
    """Hold home, bar lengths and duration against what the cell makes of the plan's poses."""
    assert plan.trajectory is not None
    start = np.abs(np.rad2deg(courses[0].travel.q[0] - cell.home))
    if start.max() > CHANGED_ANGLE_DEG:
        j = int(start.argmax())
        away = f"{start[j]:.4g} {cell.robot.joint_units[j]}"
        raise _mismatch(path, beside, f"home is {away} away from where the plan starts")
    off = cell.gauge.plan_errors(cell, plan.poses, path)
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) > CHANGED_LENGTH_MM:
        raise _mismatch(path, beside, cell.gauge.plan_error_text(plan.poses[worst].id, float(off[worst])))
    if any(part.startswith("drives") for part in changed_plan_parts(_content(path), cell)):
        return  # a person moved what is driven, which takes another time
    seconds = sum(c.trajectory.duration_s for c in courses)
    if abs(seconds / plan.trajectory.duration_s - 1.0) > CHANGED_DURATION:
        planned = plan.trajectory.duration_s
        raise _mismatch(path, beside, f"measuring would take {seconds:.2f} s, planned are {planned:.2f} s")


def _mismatch(path: Path, beside: Path, because: str) -> InputError:
    return InputError(
        f"{path} and {beside} do not belong together: {because}; "
        "one of them was changed after planning; use both as they were written, or plan again"
    )
