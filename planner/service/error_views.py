"""The map of the error to be expected: the tool's points all over the workspace, around the robot of the cell."""

from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.units import Array
from planner.service.views import SceneView, ViewCloud, ViewLayer, check_view, pack_numbers

LAYERS = (("released_mm", "calibrated"), ("geometry_mm", "geometry alone"), ("nominal_mm", "before"))
MOST_POINTS, MOST_QUANTILE = 20_000, 0.99


def map_errors(cell: Cell, table: Path) -> SceneView:
    """Return the view of a cell with the expected errors of ``expected_error.csv``.

    Raises:
        InputError: the table has no such columns.
    """
    values = np.genfromtxt(table, delimiter=",", names=True, max_rows=MOST_POINTS)
    names = values.dtype.names or ()
    missing = [n for n in ("x_mm", "y_mm", "z_mm", LAYERS[0][0]) if n not in names]
    if missing:
        raise InputError(f"{table.name}: the column '{missing[0]}' is missing")
    points = np.stack([values["x_mm"], values["y_mm"], values["z_mm"]], axis=1)
    layers = [
        ViewLayer(name=title, values=pack_numbers(values[name]), rms=_rms(values[name]))
        for name, title in LAYERS
        if name in names
    ]
    most = float(np.quantile(values[LAYERS[0][0]], MOST_QUANTILE))
    cloud = ViewCloud(what="error to be expected", unit="mm", points=pack_numbers(points), layers=layers, most=most)
    view = check_view(cell).view
    low, high = (f(np.vstack([points, view.low_mm, view.high_mm]), axis=0) for f in (np.min, np.max))
    return view.model_copy(update={"cloud": cloud, "low_mm": tuple(low.tolist()), "high_mm": tuple(high.tolist())})


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
