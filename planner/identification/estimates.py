"""Every parameter with nominal, value and uncertainty, and the units in which files and pages give them."""

from dataclasses import replace

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.common.units import DEG, MM, Array
from planner.design.observability.identifiability import DroppedParameter
from planner.effects.parameters import Parameter
from planner.identification.calibration import Calibration, Estimate
from planner.identification.least_squares import Fit
from planner.model.model import Model

ABSORBED_SHARE = 0.02  # part of a left-out parameter's direction, per prior size, below which nobody need hear of it


def estimate_parameters(
    whole: Model, fit: Fit, dropped: tuple[DroppedParameter, ...], covariance: Array
) -> tuple[Estimate, ...]:
    """Return every parameter of ``whole``, fitted or not."""
    std = dict(zip(fit.model.names, np.sqrt(np.diag(covariance)), strict=True))
    error = dict(zip(fit.model.names, fit.errors, strict=True))
    reasons = {d.name: d.because for d in dropped}
    size = dict(zip(whole.names, whole.prior, strict=True))
    out = []
    for p in whole.parameters:
        start = _nominal(whole.setup, p)
        out.append(
            Estimate(
                name=p.name,
                unit=p.unit,
                what=p.what,
                value=start + float(error.get(p.name, 0.0)),
                nominal=start,
                std=float(std[p.name]) if p.name in std else None,
                identifiable=p.name in std,
                absorbs=tuple(d.name for d in dropped if _takes_part(d, p.name, size)) if p.name in std else (),
                because=reasons.get(p.name),
                group=p.group,
            )
        )
    return tuple(out)


def _takes_part(dropped: DroppedParameter, name: str, size: dict[str, float]) -> bool:
    """Tell whether the error of a left-out parameter is carried by ``name`` to a part worth saying."""
    share = {n: abs(c) / size[n] for n, c in dropped.direction}
    return name != dropped.name and share.get(name, 0.0) > ABSORBED_SHARE * max(share.values())


def _nominal(setup: MeasurementSetup, p: Parameter) -> float:
    """Value before the fit: of the elementary transform, the fixture, the tool point, the zero."""
    if p.main.on == "reading":
        return setup.zero if p.name == "zero" else 0.0
    if p.name.startswith("fixture"):
        place = [n for n in range(len(setup.place_names)) if p.name.startswith(f"fixture_{setup.place_names[n]}_")]
        return float(setup.p_BX[place[0] if place else 0, p.main.index])
    if p.name.startswith("map_"):
        point = [n for n in range(len(setup.point_names)) if p.name.startswith(f"map_{setup.point_names[n]}_")]
        return float(setup.p_FM[point[0] if point else 0, "xyz".index(p.name[-1])])
    return setup.chain.transforms[p.main.index].nominal if p.group == "geometry" else 0.0


FILE_UNITS = {"m": ("mm", 1 / MM), "rad": ("deg", 1 / DEG), "rad/rad": ("urad/rad", 1e6)}


def file_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which files give a value of the SI ``unit``, and the factor to it: mm, deg, urad/Nm, um/N."""
    if unit in FILE_UNITS:
        return FILE_UNITS[unit]
    if unit.startswith(("m/", "rad/")):
        return f"u{unit}", 1e6
    return unit, 1.0


def displayed_estimates(calibration: Calibration) -> tuple[Estimate, ...]:
    """Return all parameters, an effect's inner number (frequency, time constant) with its whole value.

    The fit moves it about the value that the search came to; that one stands as its nominal.
    """
    traced = calibration.traced
    found = () if traced is None else traced.findings
    about = {f"{f.effect}, {f.on}, {f.inner_name}": f.inner for f in found if f.inner is not None}
    return tuple(
        e if (start := about.get(e.name)) is None else replace(e, nominal=start, value=e.value + start)
        for e in calibration.estimates
    )
