"""What ``edbb accuracy`` writes: ``accuracy.json`` (schema edbb-accuracy/1) and ``errors.csv``."""

import json

import numpy as np
import polars as pl

from planner.common.units import MM, UM, to_mm
from planner.instruments.accuracy.precision import Mastering, RepeatedCentrings
from planner.instruments.accuracy.reference_frame import ErrorFloor
from planner.instruments.accuracy.validation import ErrorFigures, ModelErrors, Validation

SCHEMA = "edbb-accuracy/1"
PUBLISHED_UM = 2.0  # largest of three centrings against the master ball by a CMM (TriCal paper, section 4)
DIGITS = 6


def validation_content(robot: str, found: Validation) -> dict[str, object]:
    """Return ``accuracy.json`` of a tracker's run."""
    misses = zip(found.nests, found.frame.misses, strict=True)
    return {
        "schema": SCHEMA,
        "kind": "validation",
        "robot": robot,
        "run": found.run.name,
        "n_poses": len(found.run),
        "frame": {"from": "nests", "nests": [{"name": n, "miss_mm": _rounded(float(m) / MM)} for n, m in misses]},
        "before": _figures_section(found.before.figures),
        "after": None if found.after is None else _figures_section(found.after.figures),
        "floor": {f"{k}_rms_mm": _rounded(v / MM) for k, v in _floor_section(found.floor)},
        "notes": list(found.notes),
    }


def precision_content(
    robot: str, run: str, found: RepeatedCentrings, master: Mastering | None, notes: tuple[str, ...] = ()
) -> dict[str, object]:
    """Return ``accuracy.json`` of repeated centrings."""
    s = found.summary
    size = np.linalg.norm(found.off, axis=1)
    return {
        "schema": SCHEMA,
        "kind": "precision",
        "robot": robot,
        "run": run,
        "poses": s.poses,
        "centrings": s.centrings,
        "max_um": _rounded(s.largest / UM),
        "rms_um": _rounded(s.rms / UM),
        "expected_rms_um": _rounded(found.expected / UM),
        "apart_um": _rounded(s.apart / UM),
        "std_um": [_rounded(float(v) / UM) for v in s.axis_std],
        "published": {"centrings": 3, "max_um": PUBLISHED_UM, "by": "a CMM, the arm left out"},
        "each": [
            {
                "pose": int(p),
                "ball": b,
                "off_um": [_rounded(float(v) / UM) for v in o],
                "size_um": _rounded(float(d) / UM),
            }
            for p, b, o, d in zip(found.pose, found.ball, found.off, size, strict=True)
        ],
        "mastering": None if master is None else _mastering_section(master),
        "notes": list(notes),
    }


def accuracy_text(content: dict[str, object]) -> str:
    """Return the text of ``accuracy.json``."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def errors_csv(found: Validation) -> str:
    """Return every validation pose with its errors, seen less predicted, in the base frame."""
    pose = found.run.samples.pose
    columns: dict[str, object] = {"pose": np.arange(1, len(found.run) + 1) if pose is None else pose}
    for name, judged in (("before", found.before), ("after", found.after)):
        columns |= {} if judged is None else _error_columns(name, judged)
    return pl.DataFrame(columns).write_csv()


def _error_columns(name: str, judged: ModelErrors) -> dict[str, object]:
    error = to_mm(judged.error)
    out: dict[str, object] = {f"{name}_{axis}_mm": np.round(e, DIGITS) for axis, e in zip("xyz", error.T, strict=True)}
    return out | {f"{name}_mm": np.round(np.linalg.norm(error, axis=1), DIGITS)}


def _figures_section(f: ErrorFigures) -> dict[str, float]:
    shares = {f"p{share}_mm": _rounded(v / MM) for share, v in f.percentiles}
    return {
        "mean_mm": _rounded(f.mean / MM),
        "max_mm": _rounded(f.largest / MM),
        "std_mm": _rounded(f.std / MM),
    } | shares


def _floor_section(f: ErrorFloor) -> tuple[tuple[str, float], ...]:
    return (("all", f.all), ("nests", f.nests), ("tracker", f.tracker), ("arm", f.arm))


def _mastering_section(m: Mastering) -> dict[str, object]:
    return {
        "wanted_mm": _rounded(m.wanted / MM),
        "off_um": [[_rounded(float(v) / UM) for v in row] for row in m.off],
        "drift_um": [_rounded(float(v) / UM) for v in m.drift],
        "good": m.good,
    }


def _rounded(value: float) -> float:
    return round(value, DIGITS)
