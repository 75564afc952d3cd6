"""What ``plan.json`` states of a plan: its quality, its tour, its path, what it will tell; each a typed table."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BeforeValidator

from planner.common.schema import OneLine, PartialModel


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

    ``after_mm``: after each pose. ``goal_mm``, ``goal_share``: what was asked for, and the share of robots that are
    below it then.
    """

    assumed: str = ""
    error_mm: Stated = None
    at_most_mm: Stated = None
    untraced_mm: Stated = None
    on_grid: GridErrorRecord | None = None
    bound_mm: Stated = None
    after_mm: tuple[Stated, ...] = ()
    floor_mm: Stated = None
    numbers: tuple[ErrorByNumberRecord, ...] = ()
    goal_mm: Stated = None
    goal_share: Stated = None
