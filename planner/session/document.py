"""``plan.json``: one document, read and written by the same class, whoever needs a part of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, field_validator, model_validator

from planner.common.errors import InputError
from planner.common.schema import OneLine, PartialModel, read_json, validate
from planner.common.units import round_angles
from planner.runs.run import Run
from planner.session.course import Role, Waypoints
from planner.session.document_parts import (
    DroppedRecord,
    ForesightRecord,
    ObservabilityRecord,
    PathRecord,
    ProgramRecord,
    SeparationProofRecord,
    SeparationRecord,
    TourRecord,
)
from planner.session.evaluations import evaluation_of

SCHEMA = "edbb-plan/1"
MOST_WAYPOINTS = 20_000  # of a drive: a plan has hundreds
MOST_DEG = 1e5  # [deg] of an angle that a controller could drive
MOST_BLEND_MM = 1e4  # [mm] of a corner that a controller could round

JointDeg = Annotated[float, Field(gt=-MOST_DEG, lt=MOST_DEG)]
"""Angle of a joint [deg], or the travel of one that slides [mm]."""


class WaypointRecord(PartialModel):
    """One waypoint of a driven path; ``visit`` is the id of the pose or −1."""

    q_deg: tuple[JointDeg, ...]
    visit: int
    blend_mm: float = Field(ge=0, lt=MOST_BLEND_MM)


class DriveRecord(PartialModel):
    """What is driven with the bar on one fixture, at one tool point where there are several."""

    fixture: OneLine
    point: OneLine = ""
    travel: tuple[WaypointRecord, ...] = Field(max_length=MOST_WAYPOINTS)
    waypoints: tuple[WaypointRecord, ...] = Field(max_length=MOST_WAYPOINTS)
    shortcuts: tuple[NonNegativeInt, ...] = ()


class PoseRecord(PartialModel):
    """One pose in visiting order."""

    id: int
    q_deg: tuple[JointDeg, ...]
    length_mm: float | None = None
    fixture: OneLine = ""
    point: OneLine = ""
    ball: OneLine | None = None
    first_contact_mm: float | None = None
    role: Role
    approach: tuple[int, ...] = ()
    repeats: int | None = None

    @field_validator("ball", mode="before")
    @classmethod
    def _name(cls, value: object) -> object:
        """Read a ball that is given by its number as one of that name."""
        return str(value) if isinstance(value, int) else value


class SupportRecord(PartialModel):
    """A support pose, driven after a pose."""

    after: int
    q_deg: tuple[JointDeg, ...]


class TrajectoryRecord(PartialModel):
    """How long the whole session takes."""

    duration_s: float
    measuring_s: float = 0.0
    tool_speed_mm_s: float | None = None
    gauge_rate_mm_s: float | None = None
    gauge_acceleration_mm_s2: float | None = None
    file: str = ""


def rename_key(value: Any, old: str, new: str) -> Any:
    """Return the content of a document with a key called otherwise, wherever it stands."""
    if isinstance(value, dict):
        return {new if key == old else key: rename_key(v, old, new) for key, v in value.items()}
    return [rename_key(v, old, new) for v in value] if isinstance(value, list | tuple) else value


class PlanHeader(PartialModel):
    """What every plan says of itself."""

    schema_: Literal["edbb-plan/1"] = Field(alias="schema")
    kind: OneLine | None = None
    plan_id: str = Field(pattern="^[0-9a-f]{12}$")
    robot: OneLine = ""
    joint_units: tuple[Literal["deg", "mm"], ...] = ()  # where a joint slides: lists of joints are called q then
    cell: OneLine = ""
    seed: int = 0
    hashes: dict[str, str] = {}

    @model_validator(mode="before")
    @classmethod
    def _in_joint_units(cls, data: object) -> object:
        """Take lists of joints in several units for what they are."""
        return rename_key(data, "q", "q_deg") if isinstance(data, dict) and data.get("joint_units") else data

    def content(self) -> dict[str, object]:
        """Return what ``plan.json`` says, in the contract's keys."""
        said = self.model_dump(mode="json", by_alias=True, exclude_unset=True)
        return said if not self.joint_units else rename_key(said, "q_deg", "q")


class PlanDocument(PlanHeader):
    """A plan of poses; ``funnel``: how many candidates each filter left, filters of the gauge among them."""

    parameters: tuple[str, ...] = ()
    dropped: tuple[DroppedRecord, ...] = ()
    funnel: dict[str, int] = {}
    poses: tuple[PoseRecord, ...] = ()
    supports: tuple[SupportRecord, ...] = ()
    observability: ObservabilityRecord = ObservabilityRecord()
    tour: TourRecord = TourRecord()
    path: PathRecord = PathRecord()
    trajectory: TrajectoryRecord | None = None
    drives: tuple[DriveRecord, ...] = Field(default=(), min_length=1)
    separation: tuple[SeparationRecord, ...] = ()
    separation_proof: SeparationProofRecord | None = None
    foresight: ForesightRecord | None = None
    programs: tuple[ProgramRecord, ...] = ()
    notes: tuple[str, ...] = ()

    def ids(self, *roles: str) -> list[int]:
        """Ids of the poses with one of these roles, of all without any named."""
        return [p.id for p in self.poses if not roles or p.role in roles]


def read_plan(path: Path, *needed: str) -> PlanDocument:
    """Read the plan at ``path``; the keys ``needed`` must be there.

    Raises:
        InputError: no such file, no plan, or a plan of another kind.
    """
    most_kind = 40  # letters of a kind of plan that a message shows
    content = read_json(path)
    if isinstance(content, dict) and content.get("kind"):
        kind = str(content["kind"])[:most_kind]
        its_own = evaluation_of("RUN", path, kind, calibrates=False)
        cure = f"; its runs are for {its_own}" if its_own else ""
        raise InputError(f"{path}: is a plan of the kind '{kind}', and a plan of poses is needed here{cure}")
    document = validate(content, PlanDocument, str(path))
    for key in needed:
        if key not in document.model_fields_set:
            raise InputError(f"{path}: the key '{key}' is missing")
    return document


def read_plan_header(path: Path) -> PlanHeader:
    """Read what a plan of any kind says of itself.

    Raises:
        InputError: no such file, or no plan.
    """
    return validate(read_json(path), PlanHeader, str(path))


class _PlanPrograms(PlanHeader):
    """The programs that were written with a plan of any kind."""

    programs: tuple[ProgramRecord, ...] = ()


def read_dialects(path: Path) -> tuple[str, ...]:
    """Return the dialects of the programs that were written with the plan at ``path``, of any kind.

    Raises:
        InputError: no such file, or no plan.
    """
    written = validate(read_json(path), _PlanPrograms, str(path)).programs
    return tuple(dict.fromkeys(p.dialect for p in written if p.dialect))


def check_run_of_plan(run: Run, path: Path, plan: PlanHeader, robot: str) -> None:
    """Refuse a plan for another robot, and a run of another plan.

    Raises:
        InputError: naming both.
    """
    if plan.robot not in ("", robot):
        raise InputError(f"{path}: is a plan for {plan.robot}, but the cell's robot is {robot}")
    if run.plan_id is not None and run.plan_id != plan.plan_id:
        raise InputError(f"{run.name}: belongs to the plan {run.plan_id}, but {path} is the plan {plan.plan_id}")


def read_waypoints(points: Sequence[WaypointRecord]) -> Waypoints:
    """Return a path from its records, with the bits that it had when it was written."""
    return Waypoints(
        round_angles(np.deg2rad([p.q_deg for p in points])),
        np.array([p.visit for p in points]),
        np.round(np.array([p.blend_mm for p in points]) / 1e3, 12),
    )
