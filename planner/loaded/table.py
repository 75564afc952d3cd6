"""What ``edbb loaded`` writes: ``curves.csv``."""

import numpy as np
import polars as pl

from planner.loaded.types import Evaluated, Loaded
from planner.units import UM, Array, to_deg, to_mm


def curves_csv(found: Loaded) -> str:
    """Return every averaged curve, one row an angle, load and sense; deflections are from the base load (eq. 8)."""
    return pl.concat([_table(c) for c in found.circles]).write_csv()


def _table(c: Evaluated) -> pl.DataFrame:
    curves = c.curves
    D, K, B = curves.length.shape
    first = curves.length[:, :1]

    def column(values: Array, decimals: int) -> Array:
        return np.round(np.broadcast_to(values, (D, K, B)).ravel(), decimals)

    predicted = np.concatenate([np.zeros((D, 1, B)), c.predicted], axis=1)
    data = {
        "fixture": np.repeat(curves.circle.name, D * K * B),
        "direction": np.repeat(np.array(curves.directions), K * B),
        "load_N": column(curves.loads[None, :, None], 2),
        "angle_deg": column(to_deg(curves.theta), 4),
        "length_mm": column(to_mm(curves.length), 6),
        "deflection_um": column((curves.length - first) / UM, 3),
        "predicted_um": column(predicted / UM, 3),
        "compensated_mm": column(to_mm(c.compensated), 6),
        "averaged_um": column(c.averaged[:, None] / UM, 3),
        "kinematic_um": column(c.kinematic[:, None] / UM, 3),
    }
    return pl.DataFrame(data)
