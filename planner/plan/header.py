"""``plan.json`` as others read it later: export, identification, simulation."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from planner.errors import InputError
from planner.schema import read_json, validate


class Loose(BaseModel):
    """A part of plan.json: only what is needed later is checked, the rest is passed over."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class WaypointFile(Loose):
    """One waypoint of a driven path."""

    q_deg: tuple[float, ...]
    visit: int
    blend_mm: float = Field(ge=0)


class DriveFile(Loose):
    """What is driven with the bar on one fixture, at one tool point where there are several."""

    fixture: str
    point: str = ""
    travel: tuple[WaypointFile, ...]
    waypoints: tuple[WaypointFile, ...]


class PoseFile(Loose):
    """One pose in visiting order."""

    id: int
    q_deg: tuple[float, ...]
    role: Literal["calibrate", "repeat", "validate", "mount"]
    approach: tuple[int, ...] = ()
    fixture: str = ""
    point: str = ""
    ball: str | None = None


class PlanFile(Loose):
    """The keys of ``plan.json`` that are read later."""

    schema_: Literal["edbb-plan/1"] = Field(alias="schema")
    plan_id: str = Field(pattern="^[0-9a-f]{12}$")
    robot: str = ""
    drives: tuple[DriveFile, ...] = Field(min_length=1)
    poses: tuple[PoseFile, ...] = ()

    def ids(self, *roles: str) -> list[int]:
        """Ids of the poses with one of these roles, of all without any named."""
        return [p.id for p in self.poses if not roles or p.role in roles]


def read_plan(path: Path) -> PlanFile:
    """Read the plan at ``path``.

    Raises:
        InputError: no such file, no plan, or a plan of circles.
    """
    content = read_json(path)
    if isinstance(content, dict) and content.get("kind") == "circular":
        raise InputError(
            f"{path}: is a plan of circles, and a plan of poses is needed here; runs of circles are for edbb circular, "
            "those under load for edbb loaded"
        )
    return validate(content, PlanFile, str(path))
