"""``identification.json`` and ``residuals.csv``: what a calibration says to other programs, in mm and degrees."""

import json

import numpy as np

from planner.identification.gauge_frames import GaugeFrames, gauge_frames
from planner.identification.leftover import Leftover, leftover
from planner.identification.residual_table import residuals_csv
from planner.identification.results_file import SCHEMA, Identification
from planner.identification.types import Calibration, Estimate, Metrics
from planner.units import DEG, MM, Array, to_deg, to_mm

__all__ = ["identification_content", "identification_text", "in_file_units", "residuals_csv"]

DIGITS = 9  # significant ones: what lies below differs with the order of a sum
SHOWN = {"m": ("mm", 1 / MM), "rad": ("deg", 1 / DEG), "rad/Nm": ("urad/Nm", 1e6)}


def in_file_units(unit: str) -> tuple[str, float]:
    """Return the unit in which files and screens give a value of the SI ``unit``, and the factor to it."""
    return SHOWN.get(unit, (unit, 1.0))


def identification_text(calibration: Calibration, left: Leftover | None = None) -> str:
    """Return the text of ``identification.json``; the same calibration gives the same bytes."""
    return json.dumps(identification_content(calibration, left), indent=1, ensure_ascii=False) + "\n"


def identification_content(calibration: Calibration, left: Leftover | None = None) -> dict[str, object]:
    """Return what ``identification.json`` says, in the contract's keys; ``left`` where it was worked out before."""
    c = calibration
    content = {
        "schema": SCHEMA,
        "robot": c.fit.model.rig.robot.name,
        "n_samples": len(c.run),
        "n_groups": c.n_groups,
        "split": {"by": c.split_by, "hold_out": c.hold_out},
        "stages": [
            {"name": s.name, "effects": list(s.effects), "parameters": s.parameters}
            | {"train": _metrics(s.train), "held_out": _metrics(s.held_out)}
            | ({} if s.validation is None else {"validation": _metrics(s.validation)})
            for s in c.stages
        ],
        "parameters": [_parameter(e) for e in c.estimates],
        "findings": [],
        "unexplained": _unexplained(c, left or leftover(c)),
        "noise_floor_mm": None if c.noise_floor is None else c.noise_floor / MM,
        "condition_number": c.condition_number if np.isfinite(c.condition_number) else None,
        "correlation_time": c.correlation_time,
        "frames": _frames(gauge_frames(c)),
        "problems": list(c.problems),
        "warnings": list(c.warnings),
    }
    whole = Identification.model_validate(_rounded(content))
    return whole.model_dump(mode="json", by_alias=True, exclude_unset=True)


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
