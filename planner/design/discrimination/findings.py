"""The findings of an identification, read from its file, and the names of effects that may occur in it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from planner.common.errors import InputError, did_you_mean
from planner.common.schema import read_json, validate
from planner.common.units import MM
from planner.kinematics.calibration_tables import si_unit

JOINTS = (
    "joint compliance",
    "compliance under drive torque",
    "payload compliance",
    "encoder once a turn",
    "encoder twice a turn",
    "gear ripple",
    "gear error curve",
    "strain-wave error",
    "motor-side error",
    "reduction ratio",
    "coupling",
    "axis wobble once a turn",
    "axis wobble twice a turn",
    "axis wobble three times a turn",
    "backlash",
    "backlash by load",
    "hysteresis",
    "unsettled angle",
    "servo lag",
)
ARM = ("link bending", "soft base", "tool compliance", "link mass", "payload mass", "link growth")
TIME = ("thermal drift", "drift", "warm-up", "session step", "remounting")
GAUGE = (
    "gauge scale",
    "gauge nonlinearity",
    "gauge cubic nonlinearity",
    "gauge sag",
    "gauge growth",
    "gauge lag",
    "ball centre",
    "scale interpolation",
    "refraction",
)
KINDS = (*JOINTS, *ARM, *TIME, *GAUGE, "unnamed")


def strip_number(name: str) -> str:
    """Return the name of an effect without its number, where it came again: ``gear ripple (2), joint 1``."""
    return re.sub(r" \(\d+\)(?=, |$)", "", name)


def check_effect_name(name: str, n_joints: int, where: str) -> None:
    """Check that an effect is one that there is, on a joint that an arm of ``n_joints`` has.

    Args:
        name: ``encoder once a turn, joint 2``.
        n_joints: joints of the robot.
        where: file and place of the name, for the message.

    Raises:
        InputError: with the nearest kind, or the joints that there are.
    """
    kind, comma, on = strip_number(name).partition(", ")
    if kind not in KINDS or not comma:
        allowed = "" if comma else "; it is called KIND, PLACE, like 'backlash, joint 2'"
        raise InputError(
            f"{where}: '{name}' is no effect{did_you_mean(kind, list(KINDS))}{allowed} (known kinds:"
            f" {', '.join(KINDS)})"
        )
    for part, most in (("joint", n_joints), ("link", n_joints + 1)):
        for number in re.findall(rf"\b{part} (\d+)", on):
            if not 1 <= int(number) <= most:
                raise InputError(f"{where}: '{name}': the robot has {part}s 1 to {most}")


class FilePart(BaseModel):
    """A part of ``identification.json``: what is needed here is checked, the rest is passed over."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class InnerPart(FilePart):
    """The number inside an effect."""

    value: float
    unit: str


class FindingPart(FilePart):
    """One finding."""

    effect: str
    on: str
    value: float
    unit: str
    rivals: tuple[str, ...]
    inner: InnerPart | None = None


class ParameterPart(FilePart):
    """One parameter of the fit."""

    name: str
    value: float
    unit: str


class ErrorPart(FilePart):
    """Errors of a set of samples."""

    rms_mm: float = Field(gt=0)


class StagePart(FilePart):
    """One stage of the fit: errors of its own samples, and of those that it never saw."""

    train: ErrorPart
    held_out: ErrorPart


class IdentificationPart(FilePart):
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
class IdentifiedEffect:
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
class IdentificationResult:
    """What an identification found.

    Attributes:
        path: of the file.
        found: its findings.
        values: of all parameters by name, in SI units.
        part: the file.
    """

    path: Path
    found: tuple[IdentifiedEffect, ...]
    values: dict[str, float]
    part: IdentificationPart

    def noise(self, width: int) -> float:
        """Noise [m] of one of the ``width`` numbers of a reading: the last stage's error, with what the fit took."""
        last, readings = self.part.stages[-1], self.part.n_samples * width / self.part.correlation_time
        taken = np.sqrt(max(readings / self.part.degrees_of_freedom, 1.0))
        return float(min(last.train.rms_mm * taken, last.held_out.rms_mm) * MM / np.sqrt(width))


def read_identification(path: Path, robot: str, n_joints: int) -> IdentificationResult:
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
            check_effect_name(name, n_joints, f"{path}: 'findings' number {k}")
    found = tuple(_read_finding(path, f) for f in part.findings)
    values = {p.name: p.value * _si_factor(path, p.unit) for p in part.parameters}
    return IdentificationResult(path, found, values, part)


def _read_finding(path: Path, f: FindingPart) -> IdentifiedEffect:
    inner = None if f.inner is None else f.inner.value * _si_factor(path, f.inner.unit)
    rivals = tuple(dict.fromkeys(strip_number(r) for r in f.rivals))
    return IdentifiedEffect(strip_number(f"{f.effect}, {f.on}"), f.value * _si_factor(path, f.unit), inner, rivals)


def _si_factor(path: Path, unit: str) -> float:
    try:
        return si_unit(unit)[1]
    except ValueError as err:
        raise InputError(f"{path}: unit '{unit}': {err}") from err
