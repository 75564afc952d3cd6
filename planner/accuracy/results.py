"""What ``edbb accuracy`` writes: ``accuracy.json`` (schema edbb-accuracy/1) and ``errors.csv``."""

import json

import numpy as np
import polars as pl

from planner.accuracy.figures import Figures
from planner.accuracy.floor import Floor
from planner.accuracy.mastering import Mastering
from planner.accuracy.precision import Repeats
from planner.accuracy.validation import Judged, Validation
from planner.units import MM, UM, to_mm

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
        "frame": {"from": "nests", "nests": [{"name": n, "miss_mm": _figure(float(m) / MM)} for n, m in misses]},
        "before": _figures(found.before.figures),
        "after": None if found.after is None else _figures(found.after.figures),
        "floor": {f"{k}_rms_mm": _figure(v / MM) for k, v in _floor(found.floor)},
        "notes": list(found.notes),
    }


def precision_content(
    robot: str, run: str, found: Repeats, master: Mastering | None, notes: tuple[str, ...] = ()
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
        "max_um": _figure(s.largest / UM),
        "rms_um": _figure(s.rms / UM),
        "expected_rms_um": _figure(found.expected / UM),
        "apart_um": _figure(s.apart / UM),
        "std_um": [_figure(float(v) / UM) for v in s.axis_std],
        "published": {"centrings": 3, "max_um": PUBLISHED_UM, "by": "a CMM, the arm left out"},
        "each": [
            {
                "pose": int(p),
                "ball": b,
                "off_um": [_figure(float(v) / UM) for v in o],
                "size_um": _figure(float(d) / UM),
            }
            for p, b, o, d in zip(found.pose, found.ball, found.off, size, strict=True)
        ],
        "mastering": None if master is None else _mastering(master),
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
        columns |= {} if judged is None else _errors(name, judged)
    return pl.DataFrame(columns).write_csv()


def _errors(name: str, judged: Judged) -> dict[str, object]:
    error = to_mm(judged.error)
    out: dict[str, object] = {f"{name}_{axis}_mm": np.round(e, DIGITS) for axis, e in zip("xyz", error.T, strict=True)}
    return out | {f"{name}_mm": np.round(np.linalg.norm(error, axis=1), DIGITS)}


def _figures(f: Figures) -> dict[str, float]:
    shares = {f"p{share}_mm": _figure(v / MM) for share, v in f.percentiles}
    return {"mean_mm": _figure(f.mean / MM), "max_mm": _figure(f.largest / MM), "std_mm": _figure(f.std / MM)} | shares


def _floor(f: Floor) -> tuple[tuple[str, float], ...]:
    return (("all", f.all), ("nests", f.nests), ("tracker", f.tracker), ("arm", f.arm))


def _mastering(m: Mastering) -> dict[str, object]:
    return {
        "wanted_mm": _figure(m.wanted / MM),
        "off_um": [[_figure(float(v) / UM) for v in row] for row in m.off],
        "drift_um": [_figure(float(v) / UM) for v in m.drift],
        "good": m.good,
    }


def _figure(value: float) -> float:
    return round(value, DIGITS)
