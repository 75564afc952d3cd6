"""``plan.json``: one document, read and written by the same class, whoever needs a part of it.

What ``plan.json`` states of a plan: its quality, its tour, its path, what it will tell; each a typed table.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, NonNegativeInt, field_validator, model_validator

from planner.common.errors import InputError
from planner.common.schema import OneLine, PartialModel, read_json, validate
from planner.common.units import round_angles
from planner.runs.run import Run
from planner.session.evaluations import evaluation_of
from planner.session.plan_types import Role, Waypoints


def _drop_infinite(value: object) -> object:
    """JSON has no word for infinity: what no body is near has no clearance."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


Stated = Annotated[float | None, BeforeValidator(_drop_infinite)]
"""A number that is told and decides nothing; nothing where it would be infinite."""


class DroppedRecord(PartialModel):
    """A parameter that the poses cannot tell, and why."""

    name: str = ""
    because: str = ""


class ProgramRecord(PartialModel):
    """A file of a program, and its language."""

    dialect: str | None = None
    file: str


class OnGridRecord(PartialModel):
    """Index of the chosen candidates before they were moved, and what no choice among them can better."""

    value: Stated = None
    bound: Stated = None
    gap: Stated = None


class ExchangeRecord(PartialModel):
    """The index that exchange would have reached where pruning chose; ``gap``: to the bound, as a share of it."""

    value: Stated = None
    gap: Stated = None


class ObservabilityRecord(PartialModel):
    """The observability indices of the poses (metres and radians; ``scaled``: unit-free), and what bounds them."""

    method: Literal["pruning"] | None = None
    exchange: ExchangeRecord | None = None
    index: OneLine | None = None
    n: int = 0
    O1: Stated = None
    O2: Stated = None
    O3: Stated = None
    O4: Stated = None
    O5: Stated = None
    scaled: Mapping[str, Stated] = {}
    bound: Stated = None
    gap: Stated = None
    bound_kind: str = ""
    bound_verified: bool = False
    on_grid: OnGridRecord | None = None
    path: Mapping[str, Stated] = {}

    def indices(self) -> dict[str, float | None]:
        """Return the five indices by name."""
        return {"O1": self.O1, "O2": self.O2, "O3": self.O3, "O4": self.O4, "O5": self.O5}


class TourRecord(PartialModel):
    """How long the tour takes: as the poses came, sorted, at least, and as driven."""

    cost_of_leg: str = ""
    solver: str = ""
    unsorted_s: Stated = None
    cost_s: Stated = None
    lower_bound_s: Stated = None
    optimal: bool = False
    driven_s: Stated = None


class VerdictRecord(PartialModel):
    """What one collision engine says of one path."""

    engine: str
    proven: bool
    clearance_mm: Stated = None


class PathRecord(PartialModel):
    """The legs of the path, how it was proven, and the bar's shortest and longest length on it."""

    legs: int | None = None
    direct_legs: int | None = None
    planned_legs: int | None = None
    checked: str = ""
    clearance_mm: Stated = None
    length_min_mm: Stated = None
    length_max_mm: Stated = None
    verdicts: tuple[VerdictRecord, ...] = ()


class SeparationRecord(PartialModel):
    """How surely one finding is told from one rival; ``noncentrality`` in noise variances, ``power`` from 0 to 1."""

    finding: str
    rival: str
    named: bool = True
    noncentrality: Stated = None
    power: Stated = None
    before: Stated = None
    bound: Stated = None
    help: tuple[str, ...] = ()


class SeparationProofRecord(PartialModel):
    """How far other poses could better the least sure of the pairs."""

    gap: Stated = None
    bound_kind: str = ""
    bound_verified: bool = False
    noise_mm: Stated = None


class GridErrorRecord(PartialModel):
    """The expected error after the chosen candidates, before they were moved."""

    error_mm: Stated = None
    gap: Stated = None


class ErrorByNumberRecord(PartialModel):
    """What another number of poses would leave, and how long it would take."""

    poses: int
    error_mm: Stated = None
    minutes: Stated = None


class ForesightRecord(PartialModel):
    """The error of the tool that is expected once hidden effects are traced.

    ``within_mm``, ``within_before_mm``: what 95 of 100 targets stay within, of 95 of 100 robots, after and before.
    ``after_mm``: after each pose. ``goal_mm``, ``goal_share``: what was asked for, and the share of robots that are
    below it then.
    """

    assumed: str = ""
    error_mm: Stated = None
    at_most_mm: Stated = None
    within_mm: Stated = None
    within_before_mm: Stated = None
    untraced_mm: Stated = None
    on_grid: GridErrorRecord | None = None
    bound_mm: Stated = None
    after_mm: tuple[Stated, ...] = ()
    floor_mm: Stated = None
    numbers: tuple[ErrorByNumberRecord, ...] = ()
    goal_mm: Stated = None
    goal_share: Stated = None


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
