"""A run written in the form of the contract, so that reading it back gives the same run."""

import io
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import write_bytes
from planner.common.units import Array, to_deg, to_mm
from planner.runs.joint_motion import session_numbers
from planner.runs.quantities import OFFSET, POSITION, TURNING
from planner.runs.run import IntArray, Run, Samples

DECIMALS = 9  # 1e-9 mm, 1e-9 degree, 1 ns: far below what is measured


def save_run(run: Run, path: Path) -> None:
    """Write ``run`` to a ``.csv`` or ``.parquet`` file in mm and degrees; the same run gives the same bytes.

    Raises:
        InputError: another ending, or the file cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in (".csv", ".parquet"):
        raise InputError(f"{path}: a run is written as .csv or .parquet, not '{path.suffix}'")
    if ending == ".csv":
        write_bytes(path, run_text(run).encode())
        return
    out = io.BytesIO()
    table_of(run).write_parquet(out, metadata=_notes(run))
    write_bytes(path, out.getvalue())


def run_text(run: Run) -> str:
    """Return ``run`` as the text of a ``.csv`` file."""
    return "".join(f"# {key}: {value}\n" for key, value in _notes(run).items()) + table_of(run).write_csv()


def _notes(run: Run) -> dict[str, str]:
    """What the lines above the columns say."""
    notes = {"measure": "continuous" if run.continuous else "static"}
    notes |= {"clocks": "2"} if run.clocks == 2 else {}
    return notes | {k: v for k, v in (("plan_id", run.plan_id), ("robot", run.robot)) if v is not None}


def table_of(run: Run) -> pl.DataFrame:
    """Return the run as columns of the contract, mm and degrees."""
    columns = _motion_columns(run.samples) | _reading_columns(run) | _other_columns(run)
    return pl.DataFrame({name: _round_floats(value) for name, value in columns.items()})


def _motion_columns(s: Samples) -> dict[str, Array]:
    columns: dict[str, Array] = {} if s.t is None else {"t_s": s.t}
    read = s.q if s.q_read is None and s.q_cmd is None else s.q_read
    for stem, angles in (("q", read), ("cmd", s.q_cmd)):
        if angles is not None:
            columns |= {f"{stem}{j}_deg": to_deg(a) for j, a in enumerate(angles.T, start=1)}
    return columns


def _reading_columns(run: Run) -> dict[str, Array | list[str]]:
    r = run.readings
    if r.length is not None:
        return {"length_mm": to_mm(r.length)}
    columns: dict[str, Array | list[str]] = {}
    if r.position is not None:
        columns |= {f"{axis}_mm": to_mm(v) for axis, v in zip(POSITION, r.position.T, strict=True)}
    if r.rotation is not None:
        turning = Rotation.from_matrix(r.rotation).as_euler("XYZ")
        columns |= {f"{axis}_deg": to_deg(v) for axis, v in zip(TURNING, turning.T, strict=True)}
    if r.ball is not None:
        columns["ball"] = [run.balls[i] for i in r.ball]
    if r.offset is not None:
        columns |= {f"{axis}_mm": to_mm(v) for axis, v in zip(OFFSET, r.offset.T, strict=True)}
    return columns


def _other_columns(run: Run) -> dict[str, Array | IntArray | list[str | None] | list[str] | pl.Series]:
    s = run.samples
    columns: dict[str, Array | IntArray | list[str | None] | list[str] | pl.Series] = {}
    if run.places != ("",):
        columns["fixture"] = [run.places[i] for i in s.place]
    if s.point is not None:
        columns["point"] = [run.points[i] for i in s.point]
    if s.session is not None and session_numbers(s).any():
        columns["session"] = s.session
    if s.pose is not None:
        columns["pose"] = pl.Series(s.pose).replace(-1, None)
    plain = {"temperature_degC": s.temperature, "force_N": s.force, "payload_kg": s.payload}
    columns |= {name: v for name, v in plain.items() if v is not None}
    if s.torque is not None:
        columns |= {f"torque{j}_Nm": v for j, v in enumerate(s.torque.T, start=1)}
    if s.direction is not None:
        columns |= {f"direction{j}": v.astype(np.int64) for j, v in enumerate(s.direction.T, start=1)}
    return columns


def _round_floats(value: object) -> object:
    """Return floats without the digits that mean nothing."""
    return np.round(value, DECIMALS) + 0.0 if isinstance(value, np.ndarray) and value.dtype.kind == "f" else value
