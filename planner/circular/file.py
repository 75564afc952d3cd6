"""``plan.json`` of a circular test: written, and read later."""

import json
from pathlib import Path
from typing import Literal

from pydantic import Field

from planner.cell import Cell
from planner.circular.types import Arc, CircularDrive, CircularPlan, Pass
from planner.plan import Waypoints
from planner.plan.file import SCHEMA, digest, rounded
from planner.plan.header import Loose, WaypointFile
from planner.schema import read_json, validate
from planner.units import to_deg, to_mm


class ArcFile(Loose):
    """One circle of ``plan.json``."""

    name: str
    plane: Literal["XY", "XZ", "YZ"]
    fixture: str
    centre_mm: tuple[float, float, float]
    radius_mm: float = Field(gt=0)
    start_deg: float
    sweep_deg: float = Field(gt=0)
    directions: tuple[Literal["ccw", "cw"], ...] = ("ccw", "cw")
    speed_mm_s: float = Field(default=10.0, gt=0)
    blend_mm: float = Field(default=10.0, gt=0)
    angle_deg: tuple[float, ...] = ()
    q_deg: tuple[tuple[float, ...], ...] = ()
    loads_N: tuple[float, ...] = ()


class PassFile(Loose):
    """One pass of ``plan.json``: a circle in one direction, or the way to the next."""

    circle: str | None = None
    direction: str = ""
    way: tuple[WaypointFile, ...] = ()


class SessionFile(Loose):
    """What is driven about one fixture."""

    fixture: str
    travel: tuple[WaypointFile, ...] = Field(min_length=2)
    passes: tuple[PassFile, ...]


class CircularPlanFile(Loose):
    """The keys of a circular test's ``plan.json`` that are read later."""

    schema_: Literal["edbb-plan/1"] = Field(alias="schema")
    kind: Literal["circular"]
    plan_id: str = Field(pattern="^[0-9a-f]{12}$")
    robot: str
    seed: int = 0
    circles: tuple[ArcFile, ...] = Field(min_length=1)
    sessions: tuple[SessionFile, ...] = ()


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
    content["programs"] = [{"dialect": name, "file": f.name} for name, files in plan.programs for f in files]
    content["notes"] = list(plan.notes)
    out = rounded(content)
    assert isinstance(out, dict)
    return out


def circular_text(plan: CircularPlan) -> str:
    """Return the text of ``plan.json``."""
    return json.dumps(circular_content(plan), indent=1, ensure_ascii=False) + "\n"


def circular_identity(plan: CircularPlan) -> str:
    """Return the plan's id: 12 hex digits of a hash over everything that decides what is driven and measured."""
    return digest(_content_of(plan), plan.cell)


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
            "verdicts": [{"engine": v.engine, "proven": v.clear, "clearance_mm": v.clearance * 1e3} for v in verdicts],
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
        "travel": _waypoints(drive.way),
        "passes": [_pass(drive, p) for p in drive.passes],
    }


def _pass(drive: CircularDrive, one: Pass) -> dict[str, object]:
    time = {"duration_s": one.trajectory.duration_s}
    if one.arc is None:
        return {"way": _waypoints(one.points), **time}
    loaded = {} if one.load is None else {"load_N": one.load}
    named = {"circle": drive.arcs[one.arc].circle.name, "direction": one.direction, "repeat": one.repeat}
    return {**named, **loaded, "marks": list(one.marks), **time}


def _waypoints(path: Waypoints) -> list[dict[str, object]]:
    return [
        {"q_deg": to_deg(q), "visit": int(v), "blend_mm": float(r) * 1e3}
        for q, v, r in zip(path.q, path.visit, path.blend, strict=True)
    ]
