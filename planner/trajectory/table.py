"""The trajectory as rows: time, controller angles and the gauge's length, for ``trajectory.csv``."""

from collections.abc import Callable

import numpy as np
import polars as pl

from planner.trajectory.trajectory import Trajectory
from planner.units import Array, to_deg, to_mm

DECIMALS = 6  # 1 µs, 1e-6 degree, 1 nm


def table(trajectory: Trajectory, dt: float, length: Callable[[Array], Array]) -> pl.DataFrame:
    """Return t_s, q1_deg … qN_deg, length_mm every ``dt`` [s] and at the end, rounded to DECIMALS.

    ``length`` maps joint angles (n, N) [rad] to the gauge's reading (n,) [m].
    """
    motion = trajectory.sample(dt)
    columns = {"t_s": motion.t}
    columns |= {f"q{j + 1}_deg": to_deg(angle) for j, angle in enumerate(motion.q.T)}
    columns["length_mm"] = to_mm(length(motion.q))
    return pl.DataFrame({name: np.round(value, DECIMALS) + 0.0 for name, value in columns.items()})


def table_csv(frame: pl.DataFrame) -> str:
    """Return the rows as CSV with DECIMALS decimals throughout: the same bytes on any machine."""
    return frame.write_csv(float_precision=DECIMALS)
