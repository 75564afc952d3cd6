"""``plan.json``: the plan in the contract's keys, the same bytes for the same input and seed."""

import hashlib
import json
from dataclasses import asdict

import numpy as np

from planner.cell import Cell
from planner.choice import Choice
from planner.foresight import ASSUMED, Foresight
from planner.observability import RULES
from planner.plan.course import DIGITS, Waypoints
from planner.plan.types import Drive, Plan, Visit
from planner.separating import Separation

SCHEMA = "edbb-plan/1"


def plan_content(plan: Plan) -> dict[str, object]:
    """Return what ``plan.json`` says, in the contract's keys."""
    content = {"schema": SCHEMA, "plan_id": plan.plan_id, **content_of(plan)}
    content["programs"] = [{"dialect": name, "file": f.name} for name, files in plan.programs for f in files]
    content["notes"] = list(plan.notes)
    short = rounded(content)
    assert isinstance(short, dict)
    return short


def plan_text(plan: Plan) -> str:
    """Return the text of ``plan.json``."""
    return json.dumps(plan_content(plan), indent=1, ensure_ascii=False) + "\n"


def identity(plan: Plan) -> str:
    """Return the plan's id: 12 hex digits of a hash over everything that decides what is driven and measured."""
    return digest(content_of(plan), plan.cell)


def digest(content: dict[str, object], cell: Cell) -> str:
    """Return 12 hex digits of a hash over what a plan says and the cell it is for."""
    whole = content | {"cell_file": cell.file.model_dump(mode="json", by_alias=True)}
    return hashlib.sha256(json.dumps(rounded(whole), sort_keys=True).encode()).hexdigest()[:12]


def content_of(plan: Plan) -> dict[str, object]:
    """Return the plan's content, without its id, its programs and its notes."""
    choice, drives = plan.choice, plan.drives
    return {
        "robot": plan.cell.robot.name,
        "cell": plan.cell.name,
        "seed": plan.seed,
        "parameters": list(choice.seen.names),
        "dropped": [{"name": d.name, "because": d.because} for d in choice.seen.dropped],
        "funnel": asdict(plan.pool.funnel),
        "poses": [_pose(plan, v) for d in drives for v in d.visits],
        "supports": [s for d in drives for s in _supports(d)],
        "observability": _observability(choice, plan.driven),
        "tour": _tour(drives),
        "path": _path(drives, plan.cell.gauge.is_bar),
        "trajectory": {
            "duration_s": sum(d.trajectory.duration_s for d in drives),
            "measuring_s": sum(d.trajectory.measuring_s for d in drives),
            "file": "trajectory.csv",
        },
        "drives": [_drive(plan, d) for d in drives],
    } | (_separation(plan.separation) | _foresight(plan.foresight))


def _pose(plan: Plan, v: Visit) -> dict[str, object]:
    pose: dict[str, object] = {"id": v.id, "q_deg": np.rad2deg(v.q)}
    if plan.cell.gauge.is_bar:
        pose |= {"length_mm": v.length * 1e3, **_place(plan.cell, v.fixture)}
    elif v.ball >= 0:
        pose |= {"ball": plan.cell.balls[v.ball].name, "first_contact_mm": (v.contact or 0.0) * 1e3}
    pose |= {"role": v.role, "approach": list(v.approach)}
    return pose if v.repeats is None else pose | {"repeats": v.repeats}


def _place(cell: Cell, fixture: int) -> dict[str, object]:
    """The fixture and, where the tool has several points, the one that the bar hangs from."""
    place: dict[str, object] = {"fixture": cell.fixtures[fixture].name}
    point = cell.point_name(fixture)
    return place | {"point": point} if point else place


def _supports(drive: Drive) -> list[dict[str, object]]:
    """Support poses, each with the id of the visit that it follows."""
    ids = np.cumsum(drive.path.node >= 0) - 1
    support = np.flatnonzero(drive.path.node < 0)
    return [{"after": drive.visits[int(ids[k])].id, "q_deg": np.rad2deg(drive.path.q[k])} for k in support]


def _observability(choice: Choice, driven: float) -> dict[str, object]:
    rule, bound = RULES[choice.index], choice.certificate
    values = {name: getattr(choice.raw, name) for name in RULES}
    scaled = {name: getattr(choice.scaled, name) for name in RULES}
    return {
        "index": choice.index,
        "n": len(choice.q),
        **values,
        "scaled": scaled,
        "bound": bound.value,
        "gap": rule.gap(choice.value, bound.value),
        "bound_kind": bound.kind,
        "bound_verified": bound.verified,
        "on_grid": {"value": choice.on_grid_value, "gap": rule.gap(choice.on_grid_value, bound.value)},
        "path": {choice.index: driven},
    }


def _separation(separation: Separation | None) -> dict[str, object]:
    """How surely findings are told from their rivals; nothing where that was not asked."""
    if separation is None:
        return {}
    proof = {
        "gap": separation.gap,
        "bound_kind": f"exactly {separation.poses} poses",
        "bound_verified": separation.verified,
        "noise_mm": separation.noise * 1e3,
    }
    return {"separation": [asdict(t) for t in separation.told], "separation_proof": proof}


def _foresight(ahead: Foresight | None) -> dict[str, object]:
    """The error of the tool that is expected after tracing; nothing where the poses were not chosen by that."""
    if ahead is None:
        return {}
    told = {
        "assumed": ASSUMED,
        "error_mm": ahead.left * 1e3,
        "untraced_mm": ahead.unknown.untraced * 1e3,
        "on_grid": {"error_mm": ahead.after[-1] * 1e3, "gap": ahead.gap},
        "bound_mm": ahead.bound * 1e3,
        "after_mm": ahead.after * 1e3,
    }
    return {"foresight": told}


def _tour(drives: tuple[Drive, ...]) -> dict[str, object]:
    return {
        "solver": ", ".join(dict.fromkeys(d.tour.solver for d in drives)),
        "unsorted_s": sum(d.tour.unsorted_s for d in drives),
        "cost_s": sum(d.tour.cost_s for d in drives),
        "lower_bound_s": sum(d.tour.lower_bound_s for d in drives),
        "optimal": all(d.tour.optimal for d in drives),
        "driven_s": sum(d.trajectory.duration_s for d in drives),
    }


def _path(drives: tuple[Drive, ...], bar: bool) -> dict[str, object]:
    legs = [leg for d in drives for leg in d.path.legs]
    direct = sum(leg.direct for leg in legs)
    lengths = {
        "length_min_mm": min(d.path.length_min for d in drives) * 1e3,
        "length_max_mm": max(d.path.length_max for d in drives) * 1e3,
    }
    return {
        "legs": len(legs),
        "direct_legs": direct,
        "planned_legs": len(legs) - direct,
        "checked": "continuous",
        "clearance_mm": min(d.path.clearance for d in drives) * 1e3,
        **(lengths if bar else {}),
        "verdicts": [
            {"engine": v.engine, "proven": v.clear, "clearance_mm": v.clearance * 1e3}
            for d in drives
            for v in d.verdicts
        ],
    }


def _drive(plan: Plan, drive: Drive) -> dict[str, object]:
    """Everything that a later export needs: the way to the mount pose, and the path with its blends."""
    m, measuring = len(drive.path.q), drive.course.measuring
    return {
        **_place(plan.cell, drive.fixture),
        "travel": _waypoints(drive.course.travel, len(drive.travel.q)),
        "waypoints": _waypoints(measuring, m),
    }


def _waypoints(path: Waypoints, count: int) -> list[dict[str, object]]:
    return [
        {"q_deg": np.rad2deg(q), "visit": int(visit), "blend_mm": float(r) * 1e3}
        for q, visit, r in zip(path.q[:count], path.visit[:count], path.blend[:count], strict=True)
    ]


def rounded(value: object) -> object:
    """Round every number to what matters, so that the last bits of a sum do not change the bytes."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    if isinstance(value, np.ndarray):
        return rounded(value.tolist())
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):  # no body, no clearance: JSON has no word for infinity
            return None
        short = round(float(value), DIGITS)
        return 0.0 if short == 0 else short
    return value.item() if isinstance(value, np.generic) else value
