"""``identification.json``: the calibration for other programs, in mm and degrees."""

import json
from math import exp, isfinite, log
from typing import Literal

import numpy as np
from pydantic import Field

from planner.common.schema import StrictModel
from planner.common.units import MM, Array, to_deg, to_mm
from planner.identification.artifact_pose import GaugeFrames, gauge_frames
from planner.identification.calibration import (
    Calibration,
    DetectionLimit,
    Estimate,
    Finding,
    Metrics,
    ResidualDiagnosis,
)
from planner.identification.estimates import displayed_estimates, file_unit

SCHEMA = "edbb-identification/1"
Position = tuple[float, float, float]


class SplitSection(StrictModel):
    """How poses were held out: whole groups of this kind, and the share of them that each fit leaves out."""

    by: str
    hold_out: float
    within: "WithinSection | None" = None


class WithinSection(StrictModel):
    """The last stage's errors where single poses are held out, beside those of whole sessions, placements or blocks."""

    by: Literal["pose"] = "pose"
    held_out: "MetricsSection"


class MetricsSection(StrictModel):
    """Errors of a set of samples; ``spread_mm`` of the rms over the folds."""

    rms_mm: float
    mean_mm: float
    max_mm: float
    spread_mm: float | None = None


class StageSection(StrictModel):
    """One stage of the fit."""

    name: str
    effects: tuple[str, ...]
    parameters: int
    train: MetricsSection
    held_out: MetricsSection
    validation: MetricsSection | None = None


class ParameterSection(StrictModel):
    """One parameter in its ``unit`` (mm, deg, urad/Nm); ``because`` says why it was left out.

    An interval about ``value`` is ``std`` times Student's t at the file's ``degrees_of_freedom``.
    """

    name: str
    value: float
    nominal: float
    std: float | None
    unit: str
    identifiable: bool
    absorbs: tuple[str, ...]
    because: str | None = None
    what: str
    group: str


class InnerSection(StrictModel):
    """The number inside an effect: a frequency, a time constant, a width."""

    name: str
    value: float
    std: float | None
    unit: str


class FindingSection(StrictModel):
    """An effect that was found in the residual; its parameters are those of the group ``effect, on``.

    ``value`` is the length of the vector of its parameters. ``p_value`` is corrected for everything that was tried;
    ``log10_p`` is its logarithm, which runs out of digits later (then it is null). ``held_out_gain`` [mm] is the fall
    of the rms on held-out samples in the stage that brought the effect.
    """

    effect: str
    on: str
    value: float
    std: float
    unit: str
    p_value: float
    log10_p: float | None
    held_out_gain: float
    rivals: tuple[str, ...]
    note: str
    inner: InnerSection | None = None


class LimitSection(StrictModel):
    """The smallest size of an effect that was not found which this run would have shown in 95 of 100 cases."""

    effect: str
    on: str
    size: float
    unit: str


class RejectedSection(StrictModel):
    """An effect that was tried in full and not kept."""

    name: str
    because: str


class UnexplainedSection(StrictModel):
    """What the model leaves on held-out samples, and along what it is not chance.

    ``rms_mm`` is all that is left, to be compared with the noise floor; ``structured_rms_mm`` the part of it that
    follows what ``along`` names.
    """

    structured: bool
    along: tuple[str, ...]
    rms_mm: float
    structured_rms_mm: float
    note: str


class FixtureSection(StrictModel):
    """Where a length gauge's fixture stands in the base frame of the calibrated robot."""

    name: str
    position_mm: Position


class PlaceSection(StrictModel):
    """How a tracker's or plate's frame stands in the base frame of the calibrated robot (fixed axes x, y, z)."""

    name: str
    position_mm: Position
    rpy_deg: Position


class PointSection(StrictModel):
    """Where a measured point sits in the flange frame."""

    name: str
    map_mm: Position


class FramesSection(StrictModel):
    """Where the gauge stands after the fit."""

    fixtures: tuple[FixtureSection, ...]
    places: tuple[PlaceSection, ...]
    tool: tuple[PointSection, ...]
    zero_mm: float | None = None


class IdentificationDocument(StrictModel):
    """``identification.json``, whole.

    ``known_anywhere_mm`` is the error of the tool that the covariance lets expect over the workspace, rms.
    """

    schema_: Literal["edbb-identification/1"] = Field(alias="schema")
    robot: str
    n_samples: int
    n_groups: int
    split: SplitSection
    stages: tuple[StageSection, ...]
    parameters: tuple[ParameterSection, ...]
    degrees_of_freedom: float
    findings: tuple[FindingSection, ...]
    limits: tuple[LimitSection, ...]
    rejected: tuple[RejectedSection, ...]
    tried: int | None
    unexplained: UnexplainedSection
    noise_floor_mm: float | None
    known_anywhere_mm: float
    condition_number: float | None
    correlation_time: float
    frames: FramesSection
    problems: tuple[str, ...]
    warnings: tuple[str, ...]


LEAST_LOG_P = -700.0  # logarithm of the smallest chance that JSON's numbers hold without loss
SIGNIFICANT_DIGITS = 9  # significant ones: what lies below differs with the order of a sum


def document_text(calibration: Calibration, left: ResidualDiagnosis) -> str:
    """Return the text of ``identification.json``; the same calibration gives the same bytes.

    ``left`` is what the tests of its residual say.
    """
    return json.dumps(document_content(calibration, left), indent=1, ensure_ascii=False) + "\n"


def document_content(calibration: Calibration, left: ResidualDiagnosis) -> dict[str, object]:
    """Return what ``identification.json`` says, in the contract's keys; ``left`` is what the residual's tests say."""
    c = calibration
    traced = c.traced
    content = {
        "schema": SCHEMA,
        "robot": c.fit.model.setup.robot.name,
        "n_samples": len(c.run),
        "n_groups": c.n_groups,
        "split": {"by": c.split_by, "hold_out": c.hold_out}
        | ({} if c.within is None else {"within": {"held_out": _metrics(c.within)}}),
        "stages": [
            {"name": s.name, "effects": list(s.effects), "parameters": s.parameters}
            | {"train": _metrics(s.train), "held_out": _metrics(s.held_out)}
            | ({} if s.validation is None else {"validation": _metrics(s.validation)})
            for s in c.stages
        ],
        "parameters": [_parameter(e) for e in displayed_estimates(c)],
        "degrees_of_freedom": degrees_of_freedom(c),
        "findings": [] if traced is None else [_finding(f) for f in traced.findings],
        "limits": [] if traced is None else [_limit(limit) for limit in traced.limits],
        "rejected": [] if traced is None else [{"name": n, "because": why} for n, why in traced.rejected],
        "tried": None if traced is None else traced.tried,
        "unexplained": _unexplained(c, left),
        "noise_floor_mm": None if c.noise_floor is None else c.noise_floor / MM,
        "known_anywhere_mm": c.workspace_error / MM,
        "condition_number": c.condition_number if np.isfinite(c.condition_number) else None,
        "correlation_time": c.correlation_time,
        "frames": _frames(gauge_frames(c)),
        "problems": list(c.problems),
        "warnings": list(c.warnings),
    }
    whole = IdentificationDocument.model_validate(_rounded(content))
    return whole.model_dump(mode="json", by_alias=True, exclude_unset=True)


def degrees_of_freedom(c: Calibration) -> float:
    """Readings, correlated ones counted as fewer, less the parameters that they decide: those of Student's t."""
    readings = len(c.fit.problem) * c.fit.model.width / c.correlation_time
    return max(1.0, readings - c.fit.effective)


def _finding(f: Finding) -> dict[str, object]:
    unit, factor = file_unit(f.unit)
    return {
        "effect": f.effect,
        "on": f.on,
        "value": f.value * factor,
        "std": f.std * factor,
        "unit": unit,
        "p_value": exp(max(f.log_p, LEAST_LOG_P)),
        "log10_p": f.log_p / log(10) if isfinite(f.log_p) else None,
        "held_out_gain": f.held_out_gain / MM,
        "rivals": list(f.rivals),
        "note": f.note,
    } | ({} if f.inner is None else {"inner": _inner(f, f.inner)})


def _inner(f: Finding, value: float) -> dict[str, object]:
    unit, factor = file_unit(f.inner_unit or "")
    std = None if f.inner_std is None else f.inner_std * factor
    return {"name": f.inner_name, "value": value * factor, "std": std, "unit": unit}


def _limit(limit: DetectionLimit) -> dict[str, object]:
    unit, factor = file_unit(limit.unit)
    return {"effect": limit.effect, "on": limit.on, "size": limit.size * factor, "unit": unit}


def _metrics(m: Metrics) -> dict[str, float]:
    out = {"rms_mm": m.rms / MM, "mean_mm": m.mean / MM, "max_mm": m.largest / MM}
    return out if m.spread is None else out | {"spread_mm": m.spread / MM}


def _parameter(e: Estimate) -> dict[str, object]:
    unit, factor = file_unit(e.unit)
    return {
        "name": e.name,
        "value": e.value * factor,
        "nominal": e.nominal * factor,
        "std": None if e.std is None else e.std * factor,
        "unit": unit,
        "identifiable": e.identifiable,
        "absorbs": list(e.absorbs),
        "what": e.what,
        "group": e.group,
    } | ({} if e.because is None else {"because": e.because})


def _unexplained(c: Calibration, left: ResidualDiagnosis) -> dict[str, object]:
    return {
        "structured": left.structured,
        "along": [t.along for t in left.found],
        "rms_mm": c.stages[-1].held_out.rms / MM,
        "structured_rms_mm": left.rms / MM,
        "note": left.sentence,
    }


def _frames(frames: GaugeFrames) -> dict[str, object]:
    out: dict[str, object] = {
        "fixtures": [{"name": n, "position_mm": _list(to_mm(p))} for n, p in frames.fixtures],
        "places": [
            {"name": n, "position_mm": _list(to_mm(p)), "rpy_deg": _list(to_deg(rpy))} for n, p, rpy in frames.places
        ],
        "tool": [{"name": n, "map_mm": _list(to_mm(p))} for n, p in frames.points],
    }
    return out if frames.zero is None else out | {"zero_mm": frames.zero / MM}


def _list(values: Array) -> list[float]:
    return [float(v) for v in values]


def _rounded(value: object) -> object:
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0 if isinstance(value, float) else value
