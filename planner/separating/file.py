"""What an identification found, as far as a plan that is to tell its findings from their rivals needs it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from planner.errors import InputError
from planner.robot.additions import si_unit
from planner.schema import read_json, validate
from planner.separating.known import check_name, once
from planner.units import MM


class Loose(BaseModel):
    """A part of ``identification.json``: what is needed here is checked, the rest is passed over."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class InnerPart(Loose):
    """The number inside an effect."""

    value: float
    unit: str


class FindingPart(Loose):
    """One finding."""

    effect: str
    on: str
    value: float
    unit: str
    rivals: tuple[str, ...]
    inner: InnerPart | None = None


class ParameterPart(Loose):
    """One parameter of the fit."""

    name: str
    value: float
    unit: str


class ErrorPart(Loose):
    """Errors of a set of samples."""

    rms_mm: float = Field(gt=0)


class StagePart(Loose):
    """One stage of the fit: errors of its own samples, and of those that it never saw."""

    train: ErrorPart
    held_out: ErrorPart


class IdentificationPart(Loose):
    """The keys of ``identification.json`` that are read here."""

    schema_: Literal["edbb-identification/1"] = Field(alias="schema")
    robot: str
    n_samples: int = Field(gt=0)
    degrees_of_freedom: float = Field(ge=1)
    correlation_time: float = Field(default=1.0, gt=0)
    stages: tuple[StagePart, ...] = Field(min_length=1)
    parameters: tuple[ParameterPart, ...]
    findings: tuple[FindingPart, ...]


@dataclass(frozen=True)
class Found:
    """A finding of the identification.

    Attributes:
        name: ``effect, on``, as the catalogue calls its entry.
        size: of the vector of its parameters, in SI units; ``inner`` its inner number, too.
        rivals: names of the entries that explain the same, the likeliest first.
    """

    name: str
    size: float
    inner: float | None
    rivals: tuple[str, ...]

    @property
    def label(self) -> str:
        """The name, with the inner number where there is one: two waves of one gear have the same name."""
        return self.name if self.inner is None else f"{self.name} ({self.inner:.4g})"


@dataclass(frozen=True)
class Identified:
    """What an identification found.

    Attributes:
        path: of the file.
        found: its findings.
        values: of all parameters by name, in SI units.
        part: the file.
    """

    path: Path
    found: tuple[Found, ...]
    values: dict[str, float]
    part: IdentificationPart

    def noise(self, width: int) -> float:
        """Noise [m] of one of the ``width`` numbers of a reading: the last stage's error, with what the fit took."""
        last, readings = self.part.stages[-1], self.part.n_samples * width / self.part.correlation_time
        taken = np.sqrt(max(readings / self.part.degrees_of_freedom, 1.0))
        return float(min(last.train.rms_mm * taken, last.held_out.rms_mm) * MM / np.sqrt(width))


def read_identified(path: Path, robot: str, n_joints: int) -> Identified:
    """Read ``identification.json`` for a plan of ``robot``, an arm of ``n_joints`` joints.

    Raises:
        InputError: no identification, one of another robot, one without rivals, or an effect that there is none of.
    """
    part = validate(read_json(path), IdentificationPart, str(path))
    if part.robot != robot:
        raise InputError(f"{path}: identifies the robot '{part.robot}', but the cell's is '{robot}'")
    if not any(f.rivals for f in part.findings):
        what = "its findings have no rivals" if part.findings else "it has no findings"
        raise InputError(f"{path}: there is nothing to separate, {what}: plan without --separate")
    for k, f in enumerate(part.findings, start=1):
        for name in (f"{f.effect}, {f.on}", *f.rivals):
            check_name(name, n_joints, f"{path}: 'findings' number {k}")
    found = tuple(_found(path, f) for f in part.findings)
    values = {p.name: p.value * _factor(path, p.unit) for p in part.parameters}
    return Identified(path, found, values, part)


def _found(path: Path, f: FindingPart) -> Found:
    inner = None if f.inner is None else f.inner.value * _factor(path, f.inner.unit)
    rivals = tuple(dict.fromkeys(once(r) for r in f.rivals))
    return Found(once(f"{f.effect}, {f.on}"), f.value * _factor(path, f.unit), inner, rivals)


def _factor(path: Path, unit: str) -> float:
    try:
        return si_unit(unit)[1]
    except ValueError as err:
        raise InputError(f"{path}: unit '{unit}': {err}") from err
