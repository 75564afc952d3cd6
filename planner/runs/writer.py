"""A run written in the form of the contract, so that reading it back gives the same run.

Data frames in and out: of polars, of pandas, or of any library that speaks Arrow or gives its columns.
"""

from __future__ import annotations

import io
import re
import tempfile
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import write_bytes
from planner.common.lazy_modules import pl
from planner.common.units import Array, IntArray
from planner.runs.images import frame_of_corners
from planner.runs.loader import load_run
from planner.runs.model_axes import AxesOf
from planner.runs.quantities import OFFSET, POSITION, TURNING
from planner.runs.run import SIMULATED, Run, ScalarReadings
from planner.runs.table import OF_JOINTS, units_of

DECIMALS = 9  # 1e-9 mm, 1e-9 degree, 1 ns: far below what is measured


def save_run(run: Run, path: Path, force: bool = False) -> None:
    """Write ``run`` to a ``.csv`` or ``.parquet`` file in mm and degrees; the same run gives the same bytes.

    With ``force`` a file that somebody else has written is replaced as well.

    Raises:
        InputError: another ending, or the file cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in (".csv", ".parquet"):
        raise InputError(f"{path}: a run is written as .csv or .parquet, not '{path.suffix}'")
    if ending == ".csv":
        write_bytes(path, run_text(run).encode(), force=force)
        return
    out = io.BytesIO()
    table_of(run).write_parquet(out, metadata=_notes(run))
    write_bytes(path, out.getvalue(), force=force)


def run_text(run: Run, remarks: str = "") -> str:
    """Return ``run`` as the text of a ``.csv`` file, with comment lines of one's own above it."""
    lines = (f"# {key}: {value}\n" for key, value in _notes(run).items())
    return remarks + "".join(line for line in lines if line not in remarks) + table_of(run).write_csv()


def _notes(run: Run) -> dict[str, str]:
    """What the lines above the columns say."""
    notes = {"measure": "continuous" if run.continuous else "static"}
    notes |= {"clocks": "2"} if run.clocks == 2 else {}
    notes |= {"truth": SIMULATED} if run.simulated else {}
    return notes | {k: v for k, v in (("plan_id", run.plan_id), ("robot", run.robot)) if v is not None}


def table_of(run: Run) -> pl.DataFrame:
    """Return the run as columns of the contract, mm and degrees."""
    s, r = run.samples, run.readings
    read = s.q if s.q_read is None and s.q_cmd is None else s.q_read
    turning = None if r.rotation is None else Rotation.from_matrix(r.rotation).as_euler("XYZ")
    turning = r.turns if r.turns is not None and not run.turns_as else turning  # to be tried against joint angles yet
    columns: dict[str, object] = _number_columns(
        (["t"], s.t),
        (_of_joints("q", read, run.slides), read),
        (_of_joints("cmd", s.q_cmd, run.slides), s.q_cmd),
        (["length"], r.length),
        *((([r.key], r.scalar),) if isinstance(r, ScalarReadings) else ()),
        (POSITION, r.position),
        (TURNING, turning),
    )
    columns |= _name_columns(("ball", r.ball, run.balls)) | _number_columns((OFFSET, r.offset))
    place = None if run.places == ("",) else s.place
    columns |= _name_columns(("fixture", place, run.places), ("point", s.point, run.points))
    if s.session_numbers.any():
        columns["session"] = s.session
    if s.pose is not None:
        columns["pose"] = pl.Series(s.pose).replace(-1, None)
    direction = None if s.direction is None else s.direction.astype(np.int64)
    columns |= _number_columns(
        (["temperature"], s.temperature),
        (["force"], s.force),
        (["payload"], s.payload),
        (_of_joints("torque", s.torque), s.torque),
        (_of_joints("direction", direction), direction),
    )
    frame = pl.DataFrame(columns)
    return frame if r.pixels is None else frame_of_corners(frame, r.pixels, DECIMALS)


def _of_joints(stem: str, values: NDArray[Any] | None, slides: Collection[int] = ()) -> list[str]:
    numbers = range(1, 1 if values is None else values.shape[1] + 1)
    return [f"{stem}{joint}_mm" if joint in slides else f"{stem}{joint}" for joint in numbers]


def _number_columns(*groups: tuple[Sequence[str], NDArray[Any] | None]) -> dict[str, object]:
    """Return quantities and their values (n,) or (n, k), where there are any, in the first unit that each has."""
    columns: dict[str, object] = {}
    for keys, values in groups:
        if values is None:
            continue
        for key, value in zip(keys, values.reshape(len(values), -1).T, strict=True):
            key, _, said = key.partition("_")
            units = units_of(key) or {}
            unit, factor = (said, units[said]) if said else next(iter(units.items()), ("", 1.0))
            whole = value.dtype.kind != "f"
            columns[f"{key}_{unit}" if unit else key] = value if whole else np.round(value / factor, DECIMALS) + 0.0
    return columns


def _name_columns(*groups: tuple[str, IntArray | None, tuple[str, ...]]) -> dict[str, object]:
    return {key: [names[i] for i in index] for key, index, names in groups if index is not None}


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
