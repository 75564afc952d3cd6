"""``identification.json``: what a calibration says to other programs, in mm and degrees."""

import json
from math import exp, isfinite, log

import numpy as np

from planner.identification.gauge_frames import GaugeFrames, gauge_frames
from planner.identification.leftover import Leftover
from planner.identification.residual_table import residuals_csv
from planner.identification.results_file import SCHEMA, Identification
from planner.identification.shown import in_file_units, shown_estimates
from planner.identification.types import Calibration, Estimate, Finding, Limit, Metrics
from planner.units import MM, Array, to_deg, to_mm

__all__ = ["identification_content", "identification_text", "residuals_csv"]

LEAST = -700.0  # logarithm of the smallest chance that JSON's numbers hold without loss
DIGITS = 9  # significant ones: what lies below differs with the order of a sum


def identification_text(calibration: Calibration, left: Leftover) -> str:
    """Return the text of ``identification.json``; the same calibration gives the same bytes.

    ``left`` is what the tests of its residual say.
    """
    return json.dumps(identification_content(calibration, left), indent=1, ensure_ascii=False) + "\n"


def identification_content(calibration: Calibration, left: Leftover) -> dict[str, object]:
    """Return what ``identification.json`` says, in the contract's keys; ``left`` is what the residual's tests say."""
    c = calibration
    traced = c.traced
    content = {
        "schema": SCHEMA,
        "robot": c.fit.model.rig.robot.name,
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
        "parameters": [_parameter(e) for e in shown_estimates(c)],
        "degrees_of_freedom": degrees_of_freedom(c),
        "findings": [] if traced is None else [_finding(f) for f in traced.findings],
        "limits": [] if traced is None else [_limit(limit) for limit in traced.limits],
        "rejected": [] if traced is None else [{"name": n, "because": why} for n, why in traced.rejected],
        "tried": None if traced is None else traced.tried,
        "unexplained": _unexplained(c, left),
        "noise_floor_mm": None if c.noise_floor is None else c.noise_floor / MM,
        "known_anywhere_mm": c.known_anywhere / MM,
        "condition_number": c.condition_number if np.isfinite(c.condition_number) else None,
        "correlation_time": c.correlation_time,
        "frames": _frames(gauge_frames(c)),
        "problems": list(c.problems),
        "warnings": list(c.warnings),
    }
    whole = Identification.model_validate(_rounded(content))
    return whole.model_dump(mode="json", by_alias=True, exclude_unset=True)


def degrees_of_freedom(c: Calibration) -> float:
    """Readings, correlated ones counted as fewer, less the parameters that they decide: those of Student's t."""
    readings = len(c.fit.problem) * c.fit.model.width / c.correlation_time
    return max(1.0, readings - c.fit.effective)


def _finding(f: Finding) -> dict[str, object]:
    unit, factor = in_file_units(f.unit)
    return {
        "effect": f.effect,
        "on": f.on,
        "value": f.value * factor,
        "std": f.std * factor,
        "unit": unit,
        "p_value": exp(max(f.log_p, LEAST)),
        "log10_p": f.log_p / log(10) if isfinite(f.log_p) else None,
        "held_out_gain": f.held_out_gain / MM,
        "rivals": list(f.rivals),
        "note": f.note,
    } | ({} if f.inner is None else {"inner": _inner(f, f.inner)})


def _inner(f: Finding, value: float) -> dict[str, object]:
    unit, factor = in_file_units(f.inner_unit or "")
    std = None if f.inner_std is None else f.inner_std * factor
    return {"name": f.inner_name, "value": value * factor, "std": std, "unit": unit}


def _limit(limit: Limit) -> dict[str, object]:
    unit, factor = in_file_units(limit.unit)
    return {"effect": limit.effect, "on": limit.on, "size": limit.size * factor, "unit": unit}


def _metrics(m: Metrics) -> dict[str, float]:
    out = {"rms_mm": m.rms / MM, "mean_mm": m.mean / MM, "max_mm": m.largest / MM}
    return out if m.spread is None else out | {"spread_mm": m.spread / MM}


def _parameter(e: Estimate) -> dict[str, object]:
    unit, factor = in_file_units(e.unit)
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


def _unexplained(c: Calibration, left: Leftover) -> dict[str, object]:
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
    return float(f"{value:.{DIGITS}g}") + 0.0 if isinstance(value, float) else value
