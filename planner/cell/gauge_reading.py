"""``[gauge]`` in SI units."""

from pathlib import Path

import numpy as np

from planner.cell.file import CellFile
from planner.cell.parts import LENGTH_GAUGES, Gauge
from planner.cell.placed import head_of
from planner.errors import InputError
from planner.units import MM, UM, from_deg

NOISE_UM = {"edbb": 1.0, "ldbb": 1.0, "draw-wire": 100.0, "tracker": 15.0, "trical": 3.0, "ball-socket": 100.0}


def gauge_of(path: Path, file: CellFile, planning: bool) -> Gauge:
    """Return the gauge of a cell file; for identification alone its range may be missing.

    Raises:
        InputError: its range is missing, or too short for its body; a head that is none.
    """
    g = file.gauge
    if g.length_mm is None and planning and g.kind != "trical":
        raise InputError(f"{path}: the key 'gauge.length_mm' is missing (shortest and longest length)")
    shortest, longest = g.length_mm or (0.0, np.inf)
    axis = (0.0, 0.0, 1.0) if file.tool is None else file.tool.map_axis
    if planning and g.kind in LENGTH_GAUGES and g.body.housing_mm + g.body.trim_mm > shortest:
        raise InputError(
            f"{path}: gauge.body.housing_mm = {g.body.housing_mm:g} and the trim of {g.body.trim_mm:g} mm at the far "
            f"ball do not fit into the shortest length {shortest:g} mm"
        )
    return Gauge(
        kind=g.kind,
        length_min=shortest * MM,
        length_max=longest * MM,
        noise=(g.noise_um or NOISE_UM[g.kind]) * UM,
        cone_fixture=float(from_deg(g.cone_deg.fixture)),
        cone_map=float(from_deg(g.cone_deg.map)),
        zero_free=g.zero == "free",
        radius=g.body.radius_mm * MM,
        housing=g.body.housing_mm * MM,
        rod_radius=g.body.rod_radius_mm * MM,
        trim=g.body.trim_mm * MM,
        noise_angle=float(from_deg(g.noise_mdeg * 1e-3)),
        head=None if g.head is None else head_of(path, g.head, axis),
    )
