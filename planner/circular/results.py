"""``circular.json``: the figures of a circular test."""

import json
import math

from planner.circular.evaluation import CircularTest
from planner.circular.figures import CircleFigures, PathFigures
from planner.circular.reversal import Reversal
from planner.units import UM, to_deg, to_mm

DIGITS = 3  # of micrometres


def circular_test_content(test: CircularTest) -> dict[str, object]:
    """Return what ``circular.json`` says."""
    return {
        "schema": "edbb-circular/1",
        "plan_id": test.plan_id,
        "run": test.run,
        "robot": test.robot,
        "circles": [_circle(c) for c in test.circles],
        "warnings": list(test.warnings),
    }


def circular_test_text(test: CircularTest) -> str:
    """Return the text of ``circular.json``."""
    return json.dumps(circular_test_content(test), indent=1, ensure_ascii=False) + "\n"


def _circle(c: CircleFigures) -> dict[str, object]:
    return {
        "name": c.ring.name,
        "plane": c.ring.plane,
        **({} if c.load is None else {"load_N": c.load}),
        "radius_mm": round(float(to_mm(c.ring.radius)), 9),
        "centre_um": [um(v) for v in c.centre.centre],
        "centre_std_um": [um(v) for v in c.centre.std],
        "paths": [_path(p) for p in c.paths],
        "G_b_um": um(c.G_b),
        "G_b_least_squares_um": um(c.G_b_ls),
        "D_um": um(c.D),
        "H_um": um(c.H),
        "H_mean_um": um(c.H_mean),
        "length_range_mm": round(float(to_mm(c.length_range)), 6),
        "deviation_from_joint_angles_range_mm": round(float(to_mm(c.calculated_range)), 6),
    }


def _path(p: PathFigures) -> dict[str, object]:
    return {
        "direction": p.direction,
        "sweeps": p.sweeps,
        "samples": p.samples,
        "G_um": um(p.G),
        "G_least_squares_um": um(p.G_ls),
        "F_max_um": um(p.F_max),
        "F_min_um": um(p.F_min),
        "mean_radial_um": um(p.mean),
        "centre_um": [um(v) for v in p.offset],
        "reversals": [_reversal(r) for r in p.reversals],
    }


def _reversal(r: Reversal) -> dict[str, object]:
    return {
        "angle_deg": round(float(to_deg(r.angle)), 2),
        "joints": [j + 1 for j in r.joints],
        "step_um": um(r.step),
        "std_um": um(r.std),
    }


def um(value: float | None) -> float | None:
    """Return a length [m] in micrometres, ``None`` where there is none."""
    if value is None or math.isnan(value):
        return None
    return round(float(value) / UM, DIGITS) + 0.0
