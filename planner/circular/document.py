"""``plan.json`` of a circular test: one document, written, and read back as the plan that is driven."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from planner.cell.cell import Cell
from planner.circular.plan import (
    Arc,
    CircularDrive,
    CircularPass,
    CircularPlan,
    circles_of,
    circular_course,
    drive_arc,
    measured_passes,
)
from planner.circular.section import CircleFile
from planner.common.errors import InputError
from planner.common.schema import OneLine, PartialModel, read_json, validate
from planner.common.units import MM, from_deg, round_angles, to_deg, to_mm
from planner.runs.run import Mounting
from planner.session.document import (
    MOST_BLEND_MM,
    JointDeg,
    PathRecord,
    PlanHeader,
    ProgramRecord,
    TrajectoryRecord,
    WaypointRecord,
    read_waypoints,
)
from planner.session.plan_record import fill_document, origin_record, verdict_records, waypoint_records
from planner.session.plan_types import time_path
from planner.session.planned_session import check_continuity, integrity_notes, read_cell_beside


class ArcRecord(CircleFile):
    """A circle as the cell's file says it, and as it is driven."""

    name: str
    speed_mm_s: float = 0.0
    slowest_mm_s: float = 0.0
    length_min_mm: float = 0.0
    length_max_mm: float = 0.0
    off_circle_um: float = 0.0
    chosen: str = ""
    blend_mm: float = Field(default=10.0, gt=0, lt=MOST_BLEND_MM)
    angle_deg: tuple[JointDeg, ...] = ()
    q_deg: tuple[tuple[JointDeg, ...], ...] = ()


class PassRecord(PartialModel):
    """One pass: a circle in one direction, or the way to the next."""

    circle: str | None = None
    direction: str = ""
    repeat: int = 0
    load_N: float | None = None
    marks: tuple[int, ...] = ()
    way: tuple[WaypointRecord, ...] = ()
    duration_s: float = 0.0


class FixtureRecord(PartialModel):
    """What is driven about one fixture, from home and back, with all that a later export needs."""

    fixture: str
    travel: tuple[WaypointRecord, ...] = Field(min_length=2)
    passes: tuple[PassRecord, ...]


class CircularDocument(PlanHeader):
    """The plan of a circular test."""

    kind: Literal["circular"]
    robot: OneLine
    circles: tuple[ArcRecord, ...] = Field(min_length=1)
    path: PathRecord = PathRecord()
    trajectory: TrajectoryRecord | None = None
    sessions: tuple[FixtureRecord, ...] = ()
    programs: tuple[ProgramRecord, ...] = ()
    notes: tuple[str, ...] = ()


def is_circular(path: Path) -> bool:
    """Tell whether the plan at ``path`` is that of a circular test.

    Raises:
        InputError: no such file, or no JSON.
    """
    content = read_json(path)
    return isinstance(content, dict) and content.get("kind") == "circular"


def read_circular_plan(path: Path) -> CircularDocument:
    """Read the plan of a circular test.

    Raises:
        InputError: no such file, or no such plan.
    """
    return validate(read_json(path), CircularDocument, str(path))


def circular_document(plan: CircularPlan) -> CircularDocument:
    """Return a plan as the document that ``plan.json`` holds."""
    return fill_document(CircularDocument, plan, {"kind": "circular", **circular_record(plan)})


def circular_record(plan: CircularPlan) -> dict[str, object]:
    """Return the plan's content, without its id, its programs and its notes."""
    cell, drives, verdicts = plan.cell, plan.drives, plan.verdicts
    return {
        **origin_record(cell, plan.seed),
        "circles": [_arc_record(cell, a) for a in plan.arcs],
        "path": PathRecord(
            checked="continuous",
            clearance_mm=min(v.clearance for v in verdicts) * 1e3,
            verdicts=verdict_records(verdicts),
        ),
        "trajectory": {
            "duration_s": sum(d.course.duration for d in drives),
            "measuring_s": sum(p.trajectory.duration_s for d in drives for p in d.passes if p.arc is not None),
            "file": "trajectory.csv",
        },
        "sessions": [
            {
                "fixture": cell.fixtures[d.mounting.fixture].name,
                "travel": waypoint_records(d.course.travel),
                "passes": [_pass_record(d, p) for p in d.passes],
            }
            for d in drives
        ],
    }


def _arc_record(cell: Cell, arc: Arc) -> dict[str, object]:
    c = arc.circle
    return {
        "name": c.name,
        "plane": c.plane,
        "fixture": cell.fixtures[c.fixture].name,
        "centre_mm": to_mm(c.p_BC),
        "radius_mm": c.radius * 1e3,
        "start_deg": float(to_deg(c.start)),
        "sweep_deg": float(to_deg(c.sweep)),
        "overshoot_deg": float(to_deg(c.overshoot)),
        "directions": list(c.directions),
        "loads_N": list(c.loads),
        "repeats": c.repeats,
        "speed_mm_s": c.speed * 1e3,
        "slowest_mm_s": arc.slowest_on_sweep * 1e3,
        "orientation": "follow" if c.follows else "constant",
        "length_min_mm": float(arc.length.min()) * 1e3,
        "length_max_mm": float(arc.length.max()) * 1e3,
        "off_circle_um": arc.off * 1e6,
        "chosen": arc.told,
        "blend_mm": arc.blend * 1e3,
        "angle_deg": to_deg(arc.angle),
        "q_deg": to_deg(arc.q),
    }


def _pass_record(drive: CircularDrive, one: CircularPass) -> dict[str, object]:
    time = {"duration_s": one.trajectory.duration_s}
    if one.arc is None:
        return {"way": waypoint_records(one.path), **time}
    loaded = {} if one.load is None else {"load_N": one.load}
    named = {"circle": drive.arcs[one.arc].circle.name, "direction": one.direction, "repeat": one.repeat}
    return {**named, **loaded, "marks": list(one.marks), **time}


def load_circular_plan(path: Path) -> CircularPlan:
    """Read a circular test with the cell beside it, as it is driven.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together.
    """
    file = read_circular_plan(path)
    cell = load_circular_cell(path, file)
    cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
    arcs = [_read_arc(path, cell, c) for c in file.circles]
    drives: list[CircularDrive] = []
    for session in file.sessions:
        mounting = Mounting([f.name for f in cell.fixtures].index(session.fixture))
        mine = tuple(a for a in arcs if a.circle.mounting == mounting)
        drives.append(_read_drive(cell, mounting, mine, session, 2 * sum(len(d.passes) for d in drives)))
    check_continuity(path, cell, [d.course for d in drives])
    notes = integrity_notes(path, cell)
    return CircularPlan(cell=cell, seed=file.seed, drives=tuple(drives), notes=notes, plan_id=file.plan_id)


def load_circular_cell(path: Path, plan: CircularDocument) -> Cell:
    """Read the cell beside a plan.

    Raises:
        InputError: it is not there, or it is not that of the plan.
    """
    beside, cell = read_cell_beside(path, "read")
    wanted, there = [c.name for c in plan.circles], [c.name for c in circles_of(cell)]
    fixtures = {s.fixture for s in plan.sessions} <= {f.name for f in cell.fixtures}
    if cell.robot.name != plan.robot or sorted(wanted) != sorted(there) or not fixtures:
        raise InputError(
            f"{path} is a plan of the circles {', '.join(wanted)} for {plan.robot}, {beside} a cell of "
            f"{cell.robot.name} with {', '.join(there) or 'no circles'}: put the cell.toml of the plan there"
        )
    return cell


def _read_arc(path: Path, cell: Cell, file: ArcRecord) -> Arc:
    circle = next(c for c in circles_of(cell) if c.name == file.name)
    if any(len(q) != cell.robot.n_joints for q in file.q_deg) or len(file.q_deg) != len(file.angle_deg):
        raise InputError(f"{path}: circle {file.name} needs {cell.robot.n_joints} joint angles at every angle")
    q, angle = round_angles(np.deg2rad(file.q_deg)), from_deg(file.angle_deg)
    off = float(np.abs(cell.map_position(q) - circle.points(angle)).max())
    if off > (1e-3 * MM):  # by which the plan's points may miss its circles
        raise InputError(
            f"{path}: the tool misses circle {file.name} of {path.parent / 'cell.toml'} by {off / MM:.3f} mm: "
            "robot, tool or circle is not that of the plan; use the cell.toml that was written with it, or plan again"
        )
    return drive_arc(cell, circle, angle, q, file.blend_mm * MM)


def _read_drive(
    cell: Cell, mounting: Mounting, arcs: tuple[Arc, ...], file: FixtureRecord, number: int
) -> CircularDrive:
    measured = measured_passes(arcs, number)
    travel = time_path(cell, read_waypoints(file.travel), mounting, bar=False)
    passes = [
        CircularPass.from_path(time_path(cell, read_waypoints(p.way), mounting, bar=True), last=p is file.passes[-1])
        if p.way
        else next(measured)
        for p in file.passes
    ]
    return CircularDrive(course=circular_course(cell, mounting, travel, passes), arcs=arcs)
