"""Data frames in and out: of polars, of pandas, or of any library that speaks Arrow or gives its columns."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from planner.common.errors import InputError
from planner.common.lazy_modules import pl
from planner.common.units import Array
from planner.runs.loader import load_run
from planner.runs.model_axes import AxesOf
from planner.runs.run import Run
from planner.runs.table import OF_JOINTS
from planner.runs.writer import table_of


def to_polars(frame: Any) -> pl.DataFrame:
    """Return a data frame of any library as one of polars: by Arrow where it can, else column by column.

    Raises:
        InputError: it is no data frame.
    """
    if isinstance(frame, pl.DataFrame):
        return frame
    if not hasattr(frame, "columns") or not hasattr(frame, "__getitem__"):
        raise InputError(f"a data frame is needed (polars, pandas, …), not {type(frame).__name__}")
    if hasattr(frame, "__arrow_c_stream__"):
        with suppress(ImportError):  # pandas needs pyarrow for it
            return pl.DataFrame(frame)
    return pl.DataFrame({str(name): np.asarray(frame[name]) for name in frame.columns})


def run_of_frame(frame: Any, n_joints: int = 6, axes_of: AxesOf | None = None) -> Run:
    """Return the run in a data frame with the columns of a run's file (``q1_deg`` …, ``length_mm``, ``fixture`` …).

    Raises:
        InputError: as :func:`planner.runs.loader.load_run`.

    Example:
        >>> run = run_of_frame(frame)  # doctest: +SKIP
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.parquet"  # a run's file is read by one reader, whatever it comes from
        to_polars(frame).write_parquet(path)
        return load_run(path, n_joints, axes_of)


def frame_of_run(run: Run) -> pl.DataFrame:
    """Return a run as a data frame of polars with the columns of a run's file, in mm and degrees.

    Example:
        >>> frame_of_run(simulate(session).run).to_pandas()  # doctest: +SKIP
    """
    return table_of(run)


def frame_angles(frame: Any, columns: Sequence[str]) -> Array:
    """Return the joint angles (n, N) [rad] of a data frame with a column for each joint, ``q1_deg`` or ``q1_rad``.

    Args:
        frame: of any library.
        columns: as the robot's joints are usually called, one each.

    Raises:
        InputError: a joint's column is missing or holds no numbers.
    """
    table = to_polars(frame)
    out = []
    for usual in columns:
        key, _, _ = usual.partition("_")
        found = [c for c in table.columns if re.fullmatch(rf"{key}_({'|'.join(OF_JOINTS['q'])})", c)]
        if len(found) != 1:
            raise InputError(f"poses: one column {usual} is needed; there are {', '.join(table.columns)}")
        values = table[found[0]]
        if not values.dtype.is_numeric():
            raise InputError(f"poses: column {found[0]} holds {values.dtype}, and numbers are needed")
        out.append(values.cast(pl.Float64).to_numpy() * OF_JOINTS["q"][found[0].partition("_")[2]])
    return np.stack(out, axis=1)
