"""What ``plan.json`` says of a plan: the same bytes for the same input and seed; and of poses without a path."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from planner.cell.cell import Cell
from planner.common.content_hashes import HASHES, changed_parts
from planner.common.errors import NoSolutionError
from planner.common.units import PLAN_DECIMALS
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.power import Discrimination
from planner.design.observability.information import INDEX_RULES
from planner.design.pose_selection import PoseChoice, Pruning
from planner.design.selection.certificate import Certificate
from planner.motion.path.verdict import Verdict
from planner.session.document import (
    SCHEMA,
    DroppedRecord,
    ErrorByNumberRecord,
    ExchangeRecord,
    ForesightRecord,
    GridErrorRecord,
    ObservabilityRecord,
    OnGridRecord,
    PathRecord,
    PlanDocument,
    PlanHeader,
    ProgramRecord,
    SeparationProofRecord,
    SeparationRecord,
    TourRecord,
    VerdictRecord,
    rename_key,
)
from planner.session.movable_cell import movable_cell
from planner.session.plan_types import Drive, Plan, SessionPlan, Visit, Waypoints
from planner.session.tour_cost import cost_name

Document = TypeVar("Document", bound=PlanHeader)


def plan_document(plan: Plan) -> PlanDocument:
    """Return a plan as the document that ``plan.json`` holds."""
    return fill_document(PlanDocument, plan, plan_record(plan))


def fill_document(document: type[Document], plan: SessionPlan, content: dict[str, object]) -> Document:
    """Return a plan of any kind as its document: its id, its content, its programs and its notes."""
    files = [ProgramRecord(dialect=name, file=f.name) for name, files in plan.programs for f in files]
    whole = {"schema": SCHEMA, "plan_id": plan.plan_id, **content, "programs": files, "notes": list(plan.notes)}
    filled = document.model_validate(round_decimals(whole))
    return filled.model_copy(update={HASHES: part_hashes(filled.content(), plan.cell)})


IN_PARTS = ("drives", "sessions")  # lists whose entries are hashed key by key


def part_hashes(content: Mapping[str, object], cell: Cell) -> dict[str, str]:
    """Return the hash of every part of what a plan says, and of its cell, so that a later reader can name what changed.

    Parts are the keys of the document, of its tables and of its drives: ``seed``, ``path.clearance_mm``,
    ``drives[0].travel``.
    """
    parts: dict[str, object] = {"cell.toml": movable_cell(cell)[0]}
    for key, value in content.items():
        if isinstance(value, dict):
            parts |= {f"{key}.{name}": v for name, v in value.items()}
        elif key in IN_PARTS and isinstance(value, list | tuple):
            tables = [v if isinstance(v, dict) else {"": v} for v in value]
            parts |= {f"{key}[{k}].{name}": v for k, table in enumerate(tables) for name, v in table.items()}
        else:
            parts[key] = value
    # 8: digits tell which part was changed, while plan_id tells whether any was
    return {name: _short_hash(value)[:8] for name, value in parts.items()}


def changed_plan_parts(content: Mapping[str, object], cell: Cell) -> tuple[str, ...]:
    """Return the parts of what ``plan.json`` says that are not as they were written; none of a plan without hashes."""
    found = part_hashes({k: v for k, v in content.items() if k != HASHES}, cell)
    return changed_parts(content.get(HASHES), found)


def _short_hash(value: object) -> str:
    return hashlib.sha256(json.dumps(round_decimals(value), sort_keys=True).encode()).hexdigest()[:12]


def content_hash(content: dict[str, object], cell: Cell) -> str:
    """Return 12 hex digits of a hash over what a plan says and the cell it is for."""
    plain = rename_key(content, "q", "q_deg") if content.get("joint_units") else content
    whole = plain | {"cell_file": movable_cell(cell)[0]}
    return _short_hash(whole)


def plan_record(plan: Plan) -> dict[str, object]:
    """Return the plan's content, without its id, its programs and its notes."""
    choice, drives = plan.choice, plan.drives
    return {
        **origin_record(plan.cell, plan.seed),
        **_identifiability_record(choice, plan.pool),
        "poses": [_pose_record(plan, v) for d in drives for v in d.visits],
        "supports": [s for d in drives for s in _support_records(d)],
        "observability": _add_driven_index(observability_record(choice, plan.certificate), plan),
        "tour": _tour_record(plan.cell, drives),
        "path": _path_record(plan),
        "trajectory": {
            "duration_s": sum(d.trajectory.duration_s for d in drives),
            "measuring_s": sum(d.trajectory.measuring_s for d in drives),
            **_largest_speeds(plan.cell, drives),
            "file": "trajectory.csv",
        },
        "drives": [_drive_record(plan, d) for d in drives],
    } | (_separation_record(plan.separation) | _forecast_record(plan))


def origin_record(cell: Cell, seed: int) -> dict[str, object]:
    """Return the record of a plan's purpose, and of the seed of everything random in it."""
    units = {"joint_units": list(cell.robot.joint_units)} if cell.robot.slides.any() else {}
    return {"robot": cell.robot.name, **units, "cell": cell.name, "seed": seed}


def _identifiability_record(choice: PoseChoice, pool: PoseSet) -> dict[str, object]:
    """Return what the poses make identifiable, and which candidates they were chosen from."""
    dropped = [DroppedRecord(name=d.name, because=d.because) for d in choice.seen.dropped]
    return {"parameters": list(choice.seen.names), "dropped": dropped, "funnel": asdict(pool.funnel)}


def _pose_record(plan: Plan, v: Visit) -> dict[str, object]:
    pose = {"id": v.id, "q_deg": np.rad2deg(v.q), **plan.cell.gauge.visit_record(plan.cell, v)}
    pose |= {"role": v.role, "approach": list(v.approach)}
    return pose if v.repeats is None else pose | {"repeats": v.repeats}


def _support_records(drive: Drive) -> list[dict[str, object]]:
    """Support poses, each with the id of the visit that it follows."""
    ids = np.cumsum(drive.path.node >= 0) - 1
    support = np.flatnonzero(drive.path.node < 0)
    return [{"after": drive.visits[int(ids[k])].id, "q_deg": np.rad2deg(drive.path.q[k])} for k in support]


def observability_record(choice: PoseChoice, bound: Certificate) -> ObservabilityRecord:
    """Return the indices of the chosen poses and what bounds them."""
    rule, among, raw = INDEX_RULES[choice.index], choice.certificate, choice.raw_indices
    stated = ObservabilityRecord(
        index=choice.index,
        n=len(choice.q),
        O1=raw["O1"],
        O2=raw["O2"],
        O3=raw["O3"],
        O4=raw["O4"],
        O5=raw["O5"],
        scaled=choice.scaled_indices,
        bound=bound.value,
        gap=max(rule.gap(choice.value, bound.value), 0.0),
        bound_kind=bound.kind,
        bound_verified=bound.verified,
        on_grid=OnGridRecord(
            value=choice.on_grid_value, bound=among.value, gap=rule.gap(choice.on_grid_value, among.value)
        ),
    )
    return stated if choice.pruning is None else stated.model_copy(update=_exchange_record(choice, choice.pruning))


def _add_driven_index(stated: ObservabilityRecord, plan: Plan) -> ObservabilityRecord:
    """Return the record with the index of the poses as they are driven."""
    return stated.model_copy(update={"path": {plan.choice.index: plan.driven}})


def _exchange_record(choice: PoseChoice, pruning: Pruning) -> dict[str, object]:
    """How the poses were chosen where exchange did not, and what that would have reached."""
    gap = INDEX_RULES[choice.index].gap(pruning.exchanged, choice.certificate.value)
    return {"method": "pruning", "exchange": ExchangeRecord(value=pruning.exchanged, gap=gap)}


def _separation_record(separation: Discrimination | None) -> dict[str, object]:
    """How surely findings are told from their rivals; nothing where that was not asked."""
    if separation is None:
        return {}
    proof = SeparationProofRecord(
        gap=separation.gap,
        bound_kind=f"exactly {separation.poses} poses",
        bound_verified=separation.verified,
        noise_mm=separation.noise * 1e3,
    )
    return {"separation": [SeparationRecord(**asdict(t)) for t in separation.told], "separation_proof": proof}


def _forecast_record(plan: Plan) -> dict[str, object]:
    """The error of the tool that is expected after tracing; its course where that chose the poses."""
    if (whole := plan.forecast) is None:
        return {}
    numbers = [ErrorByNumberRecord(poses=f.poses, error_mm=f.error * 1e3, minutes=f.minutes) for f in whole.by_number]
    common: dict[str, Any] = {
        "assumed": whole.unknown.assumptions,
        "error_mm": whole.left * 1e3,
        "at_most_mm": whole.at_most * 1e3,
        "numbers": tuple(numbers),
    }
    if (targets := plan.targets) is not None:
        common |= {"within_mm": targets.within * 1e3, "within_before_mm": targets.before * 1e3}
    if (expected := plan.expected_error) is None:
        return {"foresight": ForesightRecord(**common)}
    goal: dict[str, Any] = (
        {} if expected.until is None else {"goal_mm": expected.until * 1e3, "goal_share": expected.share_below}
    )
    told = ForesightRecord(
        **common,
        **goal,
        untraced_mm=expected.unknown.untraced_error * 1e3,
        on_grid=GridErrorRecord(error_mm=expected.on_grid * 1e3, gap=expected.gap),
        bound_mm=expected.bound * 1e3,
        after_mm=(expected.after * 1e3).tolist(),
        floor_mm=expected.floor * 1e3,
    )
    return {"foresight": told}


def _tour_record(cell: Cell, drives: tuple[Drive, ...]) -> TourRecord:
    return TourRecord(
        cost_of_leg=cost_name(cell),
        solver=", ".join(dict.fromkeys(d.tour.solver for d in drives)),
        unsorted_s=sum(d.tour.unsorted_s for d in drives),
        cost_s=sum(d.tour.cost_s for d in drives),
        lower_bound_s=sum(d.tour.lower_bound_s for d in drives),
        optimal=all(d.tour.optimal for d in drives),
        driven_s=sum(d.trajectory.duration_s for d in drives),
    )


def _largest_speeds(cell: Cell, drives: tuple[Drive, ...]) -> dict[str, float]:
    """What tool and gauge do at most while the gauge is attached, as sampled along the trajectory."""
    gauge = cell.gauge
    if not np.isfinite(gauge.rate):
        return {}
    return {
        "tool_speed_mm_s": max(d.limits.tool_speed for d in drives) * cell.motion.tool_speed * 1e3,
        "gauge_rate_mm_s": max(d.limits.reading_rate for d in drives) * gauge.rate * 1e3,
        "gauge_acceleration_mm_s2": max(d.limits.reading_acceleration for d in drives) * gauge.acceleration * 1e3,
    }


def _path_record(plan: Plan) -> PathRecord:
    drives = plan.drives
    legs = [leg for d in drives for leg in d.path.legs]
    direct = sum(leg.direct for leg in legs)
    shortest, longest = min(d.path.length_min for d in drives), max(d.path.length_max for d in drives)
    matter = bool(plan.cell.gauge.path_facts(shortest, longest))
    return PathRecord(
        legs=len(legs),
        direct_legs=direct,
        planned_legs=len(legs) - direct,
        checked="continuous",
        clearance_mm=min(d.clearance for d in drives) * 1e3,
        **({"length_min_mm": shortest * 1e3, "length_max_mm": longest * 1e3} if matter else {}),
        verdicts=verdict_records(v for d in drives for v in d.verdicts),
    )


def _drive_record(plan: Plan, drive: Drive) -> dict[str, object]:
    """Everything that a later export needs: the way to the mount pose, and the path with its blends."""
    m, measuring = len(drive.path.q), drive.course.measuring
    return {
        **plan.cell.place_record(drive.mounting),
        "travel": waypoint_records(drive.course.travel),
        "waypoints": waypoint_records(measuring, m),
        "shortcuts": list(drive.course.shortcuts),
    }


def waypoint_records(path: Waypoints, count: int | None = None) -> list[dict[str, object]]:
    """Return the first ``count`` points of a path, or all, as ``plan.json`` keeps them."""
    return [
        {"q_deg": np.rad2deg(q), "visit": int(visit), "blend_mm": float(r) * 1e3}
        for q, visit, r in zip(path.q[:count], path.visit[:count], path.blend[:count], strict=True)
    ]


def verdict_records(verdicts: Iterable[Verdict]) -> tuple[VerdictRecord, ...]:
    """Return the verdicts of each collision engine on each path."""
    return tuple(VerdictRecord(engine=v.engine, proven=v.clear, clearance_mm=v.clearance * 1e3) for v in verdicts)


def round_decimals(value: object) -> object:
    """Round every number to what matters, so that the last bits of a sum do not change the bytes."""
    if isinstance(value, BaseModel):
        return round_decimals(value.model_dump(exclude_unset=True))
    if isinstance(value, dict):
        return {k: round_decimals(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [round_decimals(v) for v in value]
    if isinstance(value, np.ndarray):
        return round_decimals(value.tolist())
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):  # no body, no clearance: JSON has no word for infinity
            return None
        short = round(float(value), PLAN_DECIMALS)
        return 0.0 if short == 0 else short
    return value.item() if isinstance(value, np.generic) else value


UNPROVEN_SCHEMA = "edbb-poses/1"


@dataclass(frozen=True)
class UnprovenPoses:
    """Chosen poses that no proven path joins.

    Attributes:
        cell: the cell; its mount poses are settled.
        seed: of the plan.
        pool: candidates.
        choice: the poses.
        certificate: no set of candidates and of the poses as chosen beats its value.
        notes: what a person must know.
        why: what was not proven, and what would help.
    """

    cell: Cell
    seed: int
    pool: PoseSet
    choice: PoseChoice
    certificate: Certificate
    notes: tuple[str, ...]
    why: str

    def record(self) -> Mapping[str, object]:
        """Return what ``plan.json`` says: its schema is that of poses, and no command takes it for a plan."""
        content: dict[str, object] = {
            "schema": UNPROVEN_SCHEMA,
            **origin_record(self.cell, self.seed),
            "not_proven": self.why,
            **_identifiability_record(self.choice, self.pool),
            "poses": [self._pose(k) for k in range(len(self.choice.q))],
            "observability": observability_record(self.choice, self.certificate),
            "notes": list(self.notes),
        }
        rounded = {key: round_decimals(value) for key, value in content.items()}
        return rename_key(rounded, "q_deg", "q") if self.cell.robot.slides.any() else rounded

    def _pose(self, k: int) -> dict[str, object]:
        q, mounting, ball = self.choice.q[k], self.choice.samples.mounting(k), self.choice.ball
        length = float(self.cell.bar_length(q[None], mounting)[0])
        visit = Visit(k, q, length, mounting, "calibrate", (0,) * len(q), ball=-1 if ball is None else int(ball[k]))
        return {"id": k, "q_deg": np.rad2deg(q), **self.cell.gauge.visit_record(self.cell, visit)}


class PathNotProvenError(NoSolutionError):
    """The limit of time was over before a path was proven; ``poses`` is what there is."""

    def __init__(self, poses: UnprovenPoses) -> None:
        super().__init__(poses.why)
        self.poses = poses
