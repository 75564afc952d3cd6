"""What ``edbb accuracy`` writes: ``accuracy.json`` (schema edbb-accuracy/1) and ``errors.csv``."""

import numpy as np
import polars as pl

from planner.common.units import in_units, to_mm
from planner.instruments.accuracy.precision import Mastering, RepeatedCentrings
from planner.instruments.accuracy.validation import ErrorFigures, ModelErrors, Validation

SCHEMA = "edbb-accuracy/1"
PUBLISHED_UM = 2.0  # largest of three centrings against the master ball by a CMM (TriCal paper, section 4)
DIGITS = 6


def validation_content(robot: str, found: Validation) -> dict[str, object]:
    """Return ``accuracy.json`` of a tracker's run."""
    f = found.floor
    misses = zip(found.nests, found.frame.misses, strict=True)
    return {
        "schema": SCHEMA,
        "kind": "validation",
        "robot": robot,
        "run": found.run.name,
        "n_poses": len(found.run),
        "frame": {"from": "nests", "nests": [{"name": n, **in_units(DIGITS, miss_mm=m)} for n, m in misses]},
        "before": _model_section(found.before),
        "after": None if found.after is None else _model_section(found.after),
        "floor": in_units(DIGITS, all_rms_mm=f.all, nests_rms_mm=f.nests, tracker_rms_mm=f.tracker, arm_rms_mm=f.arm),
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
        **in_units(DIGITS, max_um=s.largest, rms_um=s.rms, expected_rms_um=found.expected),
        **in_units(DIGITS, apart_um=s.apart, std_um=s.axis_std),
        "published": {"centrings": 3, "max_um": PUBLISHED_UM, "by": "a CMM, the arm left out"},
        "each": [
            {"pose": int(p), "ball": b, **in_units(DIGITS, off_um=o, size_um=d)}
            for p, b, o, d in zip(found.pose, found.ball, found.off, size, strict=True)
        ],
        "mastering": None if master is None else _mastering_section(master),
        "notes": list(notes),
    }


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


def _model_section(judged: ModelErrors) -> dict[str, object]:
    iso = {} if judged.performance is None else {"iso9283": judged.performance.section()}
    return _figures_section(judged.figures) | iso


def _figures_section(f: ErrorFigures) -> dict[str, object]:
    shares = {f"p{share}_mm": v for share, v in f.percentiles}
    return in_units(DIGITS, mean_mm=f.mean, max_mm=f.largest, std_mm=f.std, **shares)


def _mastering_section(m: Mastering) -> dict[str, object]:
    return {**in_units(DIGITS, wanted_mm=m.wanted, off_um=m.off, drift_um=m.drift), "good": m.good}
