"""The parameters as a person reads them: nominal, value, how well known, and what else each of them carries."""

import numpy as np

from planner.identification.fit import Fit
from planner.identification.types import Estimate
from planner.model import Model, Parameter
from planner.observability import Dropped
from planner.rig import Rig
from planner.units import Array

SHARE = 0.02  # part of a left-out parameter's direction, per prior size, below which nobody need hear of it


def estimates(whole: Model, fit: Fit, dropped: tuple[Dropped, ...], covariance: Array) -> tuple[Estimate, ...]:
    """Return every parameter of ``whole``, fitted or not."""
    std = dict(zip(fit.model.names, np.sqrt(np.diag(covariance)), strict=True))
    error = dict(zip(fit.model.names, fit.errors, strict=True))
    reasons = {d.name: d.because for d in dropped}
    size = dict(zip(whole.names, whole.prior, strict=True))
    out = []
    for p in whole.parameters:
        start = _nominal(whole.rig, p)
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


def _takes_part(dropped: Dropped, name: str, size: dict[str, float]) -> bool:
    """Tell whether the error of a left-out parameter is carried by ``name`` to a part worth saying."""
    share = {n: abs(c) / size[n] for n, c in dropped.direction}
    return name != dropped.name and share.get(name, 0.0) > SHARE * max(share.values())


def _nominal(rig: Rig, p: Parameter) -> float:
    """Value before the fit: of the elementary transform, the fixture, the tool point, the zero."""
    if p.main.on == "reading":
        return rig.zero if p.name == "zero" else 0.0
    if p.name.startswith("fixture"):
        place = [n for n in range(len(rig.place_names)) if p.name.startswith(f"fixture_{rig.place_names[n]}_")]
        return float(rig.p_BX[place[0] if place else 0, p.main.index])
    if p.name.startswith("map_"):
        point = [n for n in range(len(rig.point_names)) if p.name.startswith(f"map_{rig.point_names[n]}_")]
        return float(rig.p_FM[point[0] if point else 0, "xyz".index(p.name[-1])])
    return rig.chain.transforms[p.main.index].nominal if p.group == "geometry" else 0.0
