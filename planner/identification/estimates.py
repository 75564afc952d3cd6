"""Every parameter with nominal, value and uncertainty."""

from collections.abc import Mapping

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.common.units import Array
from planner.design.observability.identifiability import DroppedParameter
from planner.effects.parameters import Parameter
from planner.identification.least_squares import Fit
from planner.model.identification_document import Estimate
from planner.model.model import Model

ABSORBED_SHARE = 0.02  # part of a left-out parameter's direction, per prior size, below which nobody need hear of it


def estimate_parameters(
    whole: Model,
    fit: Fit,
    dropped: tuple[DroppedParameter, ...],
    covariance: Array,
    inner: Mapping[str, float] | None = None,
) -> tuple[Estimate, ...]:
    """Return every parameter of ``whole``, fitted or not.

    ``inner``: by its name, the value of an effect's inner number (frequency, time constant) that the search came to,
    about which the fit moves it; it stands as the parameter's nominal.
    """
    std = dict(zip(fit.model.names, np.sqrt(np.diag(covariance)), strict=True))
    error = dict(zip(fit.model.names, fit.errors, strict=True))
    reasons = {d.name: d.because for d in dropped}
    size = dict(zip(whole.names, whole.prior, strict=True))
    out = []
    for p in whole.parameters:
        start = _nominal(whole.setup, p) + (inner or {}).get(p.name, 0.0)
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
    """Tell whether the parameter ``name`` absorbs a relevant share of a left-out parameter's error."""
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
