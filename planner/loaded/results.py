"""What ``edbb loaded`` writes: ``loaded.json`` (schema edbb-loaded/1)."""

import json

import numpy as np

from planner.loaded.joint import Joint
from planner.loaded.told import KNOWN, Compliances
from planner.loaded.types import Comparison, Evaluated, Loaded, Offset
from planner.units import MM, UM, Array, to_deg, to_mm

URAD = 1e-6  # [rad]
SENSES = {1: "counter-clockwise", -1: "clockwise"}


def loaded_content(found: Loaded, joint: Joint | None = None) -> dict[str, object]:
    """Return the content of ``loaded.json``; ``joint`` is the fit together with unloaded runs."""
    return {
        "schema": "edbb-loaded/1",
        "robot": found.robot,
        "run": found.name,
        "compliances": _compliances(found.compliances),
        "combinations": [
            {
                "share_of_prior": _figures(c.std),
                "known": c.std < KNOWN,
                "told": c.told,
                "shares": {n: round(float(s), 4) for n, s in zip(c.names, c.shares, strict=True)},
            }
            for c in found.compliances.combinations
        ],
        "noise_um": _figures(found.compliances.noise / UM),
        "misfit": _figures(found.compliances.misfit),
        "circles": [_circle(c) for c in found.circles],
        "joint": None if joint is None else _joint(joint),
        "sentences": list(found.sentences),
        "problems": list(found.problems),
        "warnings": list(found.warnings),
    }


def loaded_text(found: Loaded, joint: Joint | None = None) -> str:
    """Return ``loaded.json``."""
    return json.dumps(loaded_content(found, joint), indent=1, ensure_ascii=False) + "\n"


def _compliances(found: Compliances) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "value_urad_Nm": _figures(value / URAD),
            "std_urad_Nm": _figures(std / URAD),
            "prior_urad_Nm": _figures(prior / URAD),
            "share_of_prior": _figures(std / prior),
            "told": told,
        }
        for name, value, std, prior, told in zip(
            found.names, found.value, found.std, found.prior, found.told, strict=True
        )
    ]


def _joint(joint: Joint) -> dict[str, object]:
    """Every parameter of the joint fit in SI units."""
    return {
        "samples": len(joint.run),
        "rms_without_load_um": round(joint.rms[0] / UM, 2),
        "rms_with_load_um": round(joint.rms[1] / UM, 2),
        "parameters": [
            {
                "name": e.name,
                "value": e.value,
                "nominal": e.nominal,
                "std": e.std,
                "unit": e.unit,
                "identifiable": e.identifiable,
                "absorbs": list(e.absorbs),
            }
            for e in joint.estimates
        ],
        "problems": list(joint.problems),
        "warnings": list(joint.run.warnings),
    }


def _circle(c: Evaluated) -> dict[str, object]:
    curves, circle = c.curves, c.curves.circle
    return {
        "fixture": circle.name,
        "centre_mm": np.round(to_mm(circle.centre), 4).tolist(),
        "radius_mm": round(circle.radius / MM, 4),
        "directions": [SENSES[d] for d in curves.directions],
        "loads_N": np.round(curves.loads, 2).tolist(),
        "repeats": curves.repeats.tolist(),
        "angles": len(curves.theta),
        "deflection_um": {
            f"{load:.0f} N": [round(float(v), 2) for v in (d.min() / UM, d.max() / UM)]
            for load, d in zip(curves.apparent, np.moveaxis(curves.deflection, 1, 0), strict=True)
        },
        "spread_um": round(c.spread / UM, 2),
        "spread_rms_um": round(c.spread_rms / UM, 2),
        "spread_of_straight_lines_um": round(c.bent / UM, 2),
        "centre_offset_mm": np.round(to_mm(c.centre_offset), 4).tolist(),
        "offset": _offset(c.offset),
        **({} if c.paper_offset is None else {"offset_as_in_the_paper": _offset(c.paper_offset)}),
        "kinematic_error_um": {"rms": _rms(c.kinematic), "largest": round(float(np.abs(c.kinematic).max()) / UM, 2)},
        "tracker": None if c.tracker is None else _tracker(c.tracker),
    }


def _offset(o: Offset) -> dict[str, float]:
    return {
        "amplitude_mm": round(o.amplitude / MM, 5),
        "frequency": round(o.frequency, 5),
        "phase_deg": round(float(to_deg(o.phase)), 4),
        "rms_left_um": round(o.rms / UM, 2),
    }


def _tracker(t: Comparison) -> dict[str, float]:
    return {"mean_um": round(t.mean / UM, 2), "largest_um": round(t.largest / UM, 2)}


def _rms(values: Array) -> float:
    return round(float(np.sqrt(np.mean(values**2))) / UM, 2)


def _figures(value: float) -> float:
    """Round to four significant digits."""
    return float(f"{value:.4g}")
