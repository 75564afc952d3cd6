"""A planned circular test: its circles, passes and drives, and their ``plan.json``."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from planner.cell.cell import Cell
from planner.cell.circles import Circle, CircleDirection
from planner.common.schema import PartialModel, read_json, validate
from planner.common.units import Array, to_deg, to_mm
from planner.motion.path.verdict import Verdict
from planner.motion.timing.trajectory import LimitReport, Trajectory
from planner.session.course import TimedPath, Waypoints
from planner.session.document import SCHEMA, PlanHeader, WaypointRecord
from planner.session.plan_record import (
    closing_record,
    content_hash,
    round_numbers,
    verdict_records,
    waypoint_records,
)
from planner.session.plan_types import Programs

SPEED_SAMPLES = 2000


@dataclass(frozen=True)
class Arc:
    """A circle with overshoot as the arm drives it, in the sense in which angles grow.

    Attributes:
        circle: which.
        angle: of the points (m,) [rad].
        q: controller angles there, (m, N) [rad].
        length: of the bar there, (m,) [m].
        off: largest distance of the trajectory from the circle [m].
        blend: distance from each point at which its corner may be cut [m].
        trajectory: timed from rest to rest; back: driven the other way.
        verdicts: of both collision engines; limits: the trajectory held against the axes' limits.
        told: how the way round was chosen. A plan read back has none of these three.
    """

    circle: Circle
    angle: Array
    q: Array
    length: Array
    off: float
    blend: float
    trajectory: Trajectory
    back: Trajectory
    verdicts: tuple[Verdict, ...] = ()
    limits: LimitReport | None = None
    told: str = ""

    def waypoints(self) -> Waypoints:
        """Return the points with marks (0 and 1) at both ends of the sweep and the radius of every blend."""
        radius = np.full(len(self.q), self.blend)
        radius[[0, -1]] = 0.0
        marks = np.full(len(self.q), -1)
        marks[np.flatnonzero(self.sweep)[[0, -1]]] = (0, 1)
        return Waypoints(self.q, marks, radius)

    @property
    def slowest_on_sweep(self) -> float:
        """Smallest speed of the tool point on the sweep, going and coming [m/s]."""
        marks = np.flatnonzero(self.sweep)[[0, -1]]
        ways = ((self.trajectory, marks), (self.back, len(self.q) - 1 - marks[::-1]))
        share = np.linspace(0.0, 1.0, SPEED_SAMPLES)
        slowest = []
        for trajectory, (first, last) in ways:
            begin, end = trajectory.waypoint_time[first], trajectory.waypoint_time[last]
            slowest.append(float(trajectory.at(begin + share * (end - begin)).tool_speed.min()))
        return min(slowest)

    @property
    def sweep(self) -> np.ndarray:
        """Which points lie on the sweep that is measured, (m,) bool."""
        past = self.angle - self.circle.start
        return np.asarray((past > -1e-9) & (past < self.circle.sweep + 1e-9))


@dataclass(frozen=True)
class CircularPass:
    """One stretch of the session with the bar on, from rest to rest.

    Attributes:
        arc: which of the session's arcs it measures, ``None`` on the way from one to the next.
        direction: in which, "" on the way.
        load: force along the bar [N], ``None`` without.
        repeat: counts from 0.
        path: with the ids of the marks at both ends of the sweep.
    """

    arc: int | None
    direction: CircleDirection | str
    load: float | None
    repeat: int
    path: TimedPath

    @classmethod
    def between(cls, path: TimedPath) -> "CircularPass":
        """Return the way from one circle to the next."""
        return cls(None, "", None, 0, path)

    @property
    def trajectory(self) -> Trajectory:
        """The path in time."""
        return self.path.trajectory

    @property
    def marks(self) -> tuple[int, ...]:
        """Ids of the marks on the way."""
        return tuple(int(v) for v in self.path.visit if v >= 0)


@dataclass(frozen=True)
class CircularDrive:
    """All circles about one fixture.

    Attributes:
        fixture: which.
        arcs: its circles.
        travel: from home to the mount pose, without the bar; it is driven back at the end.
        passes: with the bar on, from the mount pose back to it, in order.
        verdicts: of both engines on the travel and on the ways between circles.
    """

    fixture: int
    arcs: tuple[Arc, ...]
    travel: TimedPath
    passes: tuple[CircularPass, ...]
    verdicts: tuple[Verdict, ...] = ()

    @property
    def duration(self) -> float:
        """Time with the bar on [s]."""
        return sum(p.trajectory.duration_s for p in self.passes)


@dataclass(frozen=True)
class CircularPlan:
    """A planned circular test: the cell with its mount poses, what is driven, and the programs."""

    plan_id: str
    cell: Cell
    seed: int
    drives: tuple[CircularDrive, ...]
    programs: Programs = ()
    notes: tuple[str, ...] = ()


def measured_passes(arcs: Sequence[Arc], number: int) -> Iterator[CircularPass]:
    """Every pass that is measured, in order, with marks at both ends of its sweep, counted from ``number``."""
    for k, arc in enumerate(arcs):
        there = arc.waypoints()
        for load in arc.circle.loads or (None,):
            for repeat in range(arc.circle.repeats):
                for direction in arc.circle.directions:
                    points = there if direction == "ccw" else there.reversed()
                    trajectory = arc.trajectory if direction == "ccw" else arc.back
                    ids = np.full(len(points.q), -1)
                    ids[np.flatnonzero(points.visit >= 0)] = (number, number + 1)
                    number += 2
                    timed = TimedPath(points.q, ids, points.blend, trajectory)
                    yield CircularPass(k, direction, load, repeat, timed)


class ArcFile(PartialModel):
    """One circle of ``plan.json``, as driven; what it is stands in the cell beside it."""

    name: str
    sweep_deg: float = Field(gt=0)
    directions: tuple[Literal["ccw", "cw"], ...] = ("ccw", "cw")
    blend_mm: float = Field(default=10.0, gt=0)
    angle_deg: tuple[float, ...] = ()
    q_deg: tuple[tuple[float, ...], ...] = ()


class PassFile(PartialModel):
    """One pass of ``plan.json``: a circle in one direction, or the way to the next."""

    circle: str | None = None
    direction: str = ""
    way: tuple[WaypointRecord, ...] = ()


class CircularSessionFile(PartialModel):
    """What is driven about one fixture."""

    fixture: str
    travel: tuple[WaypointRecord, ...] = Field(min_length=2)
    passes: tuple[PassFile, ...]


class CircularPlanFile(PlanHeader):
    """The keys of a circular test's ``plan.json`` that are read later."""

    kind: Literal["circular"]
    robot: str
    seed: int = 0
    circles: tuple[ArcFile, ...] = Field(min_length=1)
    sessions: tuple[CircularSessionFile, ...] = ()


def is_circular(path: Path) -> bool:
    """Tell whether the plan at ``path`` is that of a circular test.

    Raises:
        InputError: no such file, or no JSON.
    """
    content = read_json(path)
    return isinstance(content, dict) and content.get("kind") == "circular"


def read_circular_plan(path: Path) -> CircularPlanFile:
    """Read the plan of a circular test.

    Raises:
        InputError: no such file, or no such plan.
    """
    return validate(read_json(path), CircularPlanFile, str(path))


def circular_content(plan: CircularPlan) -> dict[str, object]:
    """Return what ``plan.json`` says."""
    content = {"schema": SCHEMA, "kind": "circular", "plan_id": plan.plan_id, **_content_of(plan)}
    out = round_numbers(content | closing_record(plan.programs, plan.notes))
    assert isinstance(out, dict)
    return out


def circular_identity(plan: CircularPlan) -> str:
    """Return the plan's id: 12 hex digits of a hash over everything that decides what is driven and measured."""
    return content_hash(_content_of(plan), plan.cell)


def _content_of(plan: CircularPlan) -> dict[str, object]:
    cell, drives = plan.cell, plan.drives
    verdicts = [v for d in drives for part in (*(a.verdicts for a in d.arcs), d.verdicts) for v in part]
    return {
        "robot": cell.robot.name,
        "cell": cell.name,
        "seed": plan.seed,
        "circles": [_circle(cell, a) for d in drives for a in d.arcs],
        "path": {
            "checked": "continuous",
            "clearance_mm": min(v.clearance for v in verdicts) * 1e3,
            "verdicts": verdict_records(verdicts),
        },
        "trajectory": {
            "duration_s": sum(d.duration for d in drives),
            "measuring_s": sum(p.trajectory.duration_s for d in drives for p in d.passes if p.arc is not None),
            "file": "trajectory.csv",
        },
        "sessions": [_session(cell, d) for d in drives],
    }


def _circle(cell: Cell, arc: Arc) -> dict[str, object]:
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


def _session(cell: Cell, drive: CircularDrive) -> dict[str, object]:
    """What is driven about one fixture, from home and back, with all that a later export needs."""
    return {
        "fixture": cell.fixtures[drive.fixture].name,
        "travel": waypoint_records(drive.travel),
        "passes": [_pass(drive, p) for p in drive.passes],
    }


def _pass(drive: CircularDrive, one: CircularPass) -> dict[str, object]:
    time = {"duration_s": one.trajectory.duration_s}
    if one.arc is None:
        return {"way": waypoint_records(one.path), **time}
    loaded = {} if one.load is None else {"load_N": one.load}
    named = {"circle": drive.arcs[one.arc].circle.name, "direction": one.direction, "repeat": one.repeat}
    return {**named, **loaded, "marks": list(one.marks), **time}
