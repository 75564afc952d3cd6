"""The rows of a calibration's tables, in mm and degrees; where the unit differs row by row, a column says it."""

from planner.common.tables import Row
from planner.common.units import display_unit, file_unit, si_unit, to_deg, to_mm
from planner.model.finding import Finding
from planner.model.gauge_frames import ToolPointPosition
from planner.model.identification_document import Estimate, Stage


def border_unit(e: Estimate) -> tuple[str, float]:
    """Return the unit a parameter is shown in, and the factor from SI: mm or deg for geometry, else a small one."""
    if e.group in ("gauge", "geometry"):
        unit = file_unit(e.unit)
        return unit, 1 / si_unit(unit)[1]
    return display_unit(e.unit, max(abs(e.value), e.std or 0.0))


def parameter_row(e: Estimate) -> Row:
    """Return a parameter: value, standard deviation and by how much it moved, in its unit; why it has no deviation."""
    unit, factor = border_unit(e)
    return {
        "parameter": e.name,
        "value": e.value * factor,
        "sigma": e.std * factor if e.identifiable and e.std is not None else None,
        "moved_by": (e.value - e.nominal) * factor,
        "unit": unit,
        "seen": e.identifiable,
        "because": e.because,
        "stands_also_for": ", ".join(e.absorbs),
        "group": e.group,
    }


def finding_row(f: Finding, reading_unit: str) -> Row:
    """Return a finding: what, where, its size with its deviation, and what this run cannot tell from it.

    ``reading_unit``: of errors of readings, mm or mrad.
    """
    unit, factor = display_unit(f.unit, f.value)
    return {
        "effect": f.effect,
        "on": f.on,
        "value": f.value * factor,
        "sigma": f.std * factor,
        "unit": unit,
        "grade": f.grade,
        "probability": f.probability,
        "p_value": f.p_value,
        f"held_out_gain_{reading_unit}": float(to_mm(f.gain)),
        "rivals": ", ".join(f.rivals),
        "note": f.note,
    }


def tool_row(point: ToolPointPosition) -> Row:
    """Return where a tool point sits in the flange frame, with its standard deviations."""
    place = {f"{axis}_mm": float(to_mm(v)) for axis, v in zip("xyz", point.p_FM, strict=True)}
    std = point.std_beside_robot or (None, None, None)
    sigma = {f"sigma_{axis}_mm": None if v is None else float(to_mm(v)) for axis, v in zip("xyz", std, strict=True)}
    return {"point": point.name, **place, **sigma}


def stage_row(s: Stage, reading_unit: str) -> Row:
    """Return a stage of the fit and its errors of readings, in mm or mrad."""
    held, checked = s.held_out, s.validation
    return {
        "stage": s.name,
        "parameters": s.parameters,
        f"fitted_rms_{reading_unit}": float(to_mm(s.train.rms)),
        f"held_out_rms_{reading_unit}": float(to_mm(held.rms)),
        f"held_out_mean_{reading_unit}": float(to_mm(held.mean)),
        f"held_out_largest_{reading_unit}": float(to_mm(held.largest)),
        f"validation_mean_{reading_unit}": None if checked is None else float(to_mm(checked.mean)),
    }


def error_rows(
    heads: list[str], q: list[list[float]], position: list[list[float]], errors: list[list[float]]
) -> list[Row]:
    """Return the states of the workspace [rad, m]: joints (``heads``), tool point, errors of three robots."""
    return [
        {name: float(to_deg(v)) for name, v in zip(heads, angles, strict=True)}
        | {f"{axis}_mm": float(to_mm(v)) for axis, v in zip("xyz", place, strict=True)}
        | {f"{n}_mm": float(to_mm(v)) for n, v in zip(("nominal", "geometry", "released"), off, strict=True)}
        for angles, place, off in zip(q, position, errors, strict=True)
    ]
