"""Traces of controllers and gauges brought into one run by a column map.

Readings that stand a row beside the angles that they belong to: found where the robot is known.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import regex

from planner.common.errors import InputError, did_you_mean
from planner.common.lazy_modules import pl
from planner.common.schema import read_toml
from planner.common.units import Array, to_mm
from planner.kinematics.angle_units import DEGREES, NOTE
from planner.kinematics.axes import MODEL
from planner.kinematics.axes_line import KEY as AXES_OF
from planner.kinematics.axes_line import axes_line
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.runs.clock_times import seconds_of
from planner.runs.column_map import ColumnMap, TraceMap
from planner.runs.loader import run_of
from planner.runs.model_axes import in_model_axes
from planner.runs.run import SIMULATED, Run
from planner.runs.synchronisation import pair_tables
from planner.runs.table import NAMES, RunColumn, RunTable, read_table, table_in_si
from planner.runs.text import RowSource, numbers_in, parse_rows, read_lines, separator_hint


def refuse_shifted_rows(run: Run, robot: Robot) -> None:
    """Refuse a run whose readings fit the nominal robot much better a row or more away.

    Wherever gauge and target are, a position is linear in the flange's position and orientation, and the square of a
    length in them and in the position seen from the flange. So the fit needs neither.

    Raises:
        InputError: with the shift, and the errors with and without it.
    """
    most_shift = 3  # [rows] that are tried to either side
    more_rows = 2  # rows an unknown of the fit, from which on rows beside each other fit by chance no more
    sure = 0.2  # of the error as the rows stand: what a shift leaves where it is the right one
    readings = run.readings.position if run.readings.position is not None else run.readings.length
    one = len(run.places) == 1 and len(run.points) == 1
    if readings is None or run.continuous or not one or run.samples.q.shape[1] != robot.n_joints:
        return
    y = readings if readings.ndim == 2 else readings[:, None] ** 2
    A = _unknowns(robot, run.samples.q, readings.ndim == 1)
    if len(y) < more_rows * A.shape[1] + most_shift:
        return
    errors = {shift: _error(A, y, shift) for shift in range(-most_shift, most_shift + 1)}
    if readings.ndim == 1:  # of a square, the error of a length is half of it by the length
        errors = {shift: e / (2 * float(readings.mean())) for shift, e in errors.items()}
    best = min(errors, key=lambda shift: errors[shift])
    if best and errors[best] < sure * errors[0]:
        rows, side = f"{abs(best)} row{'s' * (abs(best) > 1)}", "below" if best > 0 else "above"
        raise InputError(
            f"{run.name}: each reading belongs to the angles of another row: those {rows} {side} fit {robot.name} to "
            f"{to_mm(errors[best]):.2g} mm, those of the same row to {to_mm(errors[0]):.2g} mm; one log has begun "
            f"{rows} {'earlier' if best > 0 else 'later'} than the other: take out its first rows, and the last ones "
            "of the other"
        )


def _unknowns(robot: Robot, q: Array, squares: bool) -> Array:
    """Return what readings at angles (n, N) are linear in, (n, k)."""
    stand = robot.chain.forward(robot.theta(q))
    p, R = stand.x.T, np.moveaxis(stand.R, 2, 0)
    columns = [np.ones((len(q), 1)), p, R.reshape(len(q), 9)]
    if squares:
        columns += [np.einsum("nij,ni->nj", R, p), (p**2).sum(axis=1)[:, None]]
    return np.column_stack(columns)


def _error(A: Array, y: Array, shift: int) -> float:
    """Return the root mean square of what a fit leaves of readings that stand ``shift`` rows below their angles."""
    n = len(y) - abs(shift)
    A, y = A[max(-shift, 0) :][:n], y[max(shift, 0) :][:n]
    solution, _, rank, _ = np.linalg.lstsq(A, y)
    return float(np.sqrt(((y - A @ solution) ** 2).sum() / max((n - int(rank)) * y.shape[1], 1)))


LINE_SECONDS = 2.0  # [s] in which a sound pattern is through with any line
SAID = {  # anywhere in a trace
    "plan_id": re.compile(r"plan_id\W+([0-9a-f]{12})\b"),
    "truth": re.compile(f"truth: ({SIMULATED})"),
    NOTE: re.compile(rf"^\W*{NOTE}: ({DEGREES})\W*$", re.MULTILINE),
}


def read_trace(path: Path, trace: TraceMap, notes: Mapping[str, str]) -> RunTable:
    """Read a trace through its map.

    Raises:
        InputError: the file does not have what the map says, or a field is no number; with line and column.
    """
    lines = read_lines(path, trace.encoding)
    text = "\n".join(lines)
    found = {key: m[1] for key, pattern in SAID.items() if (m := pattern.search(text))}
    other, wanted = found.get("plan_id"), notes.get("plan_id", found.get("plan_id"))
    if other != wanted and other is not None:
        raise InputError(f"{path}: was kept while plan {other} was driven, not plan {wanted}")
    language = axes_line(str(path), lines)
    if language not in (None, notes.get(AXES_OF)):
        raise InputError(
            f"{path}: says '{AXES_OF}: {language}', the map says {notes.get(AXES_OF, 'nothing of it')}: let both say "
            "the same"
        )
    notes = {**found, **notes}
    read = _read_matches if trace.pattern else _read_separated_columns
    source, frame = read(str(path), lines, trace)
    columns = [trace.column_of(name) for name in trace.names]
    frame = frame.select(
        _scaled_column(name, c, trace).alias(c.header) for name, c in zip(trace.names, columns, strict=True)
    )
    constants = [trace.column_of(name) for name in trace.constants]
    frame = frame.with_columns(_constant_column(c, v) for c, v in zip(constants, trace.constants.values(), strict=True))
    table = table_in_si(source, frame, [*columns, *constants], notes)
    return _without_unwritten(table) if trace.pattern else table


def is_trace_of(path: Path, trace: TraceMap) -> bool:
    """Tell whether a line of the file is one that the map's pattern reads; ``True`` for a map of columns."""
    if trace.pattern is None:
        return True
    pattern = regex.compile(trace.pattern)
    return any(pattern.search(line, timeout=LINE_SECONDS) for line in read_lines(path, trace.encoding))


def _scaled_column(name: str, target: RunColumn, trace: TraceMap) -> pl.Expr:
    if trace.pattern is not None or target.stem in NAMES:
        return pl.col(name)
    picked = trace.column(name)
    value = pl.col(name) if picked.factor == 1.0 else pl.col(name) * picked.factor
    if picked.nanoseconds is not None:
        value = value + pl.col(f"{name}/nanoseconds") * 1e-9
    return value if picked.offset == 0.0 else value + picked.offset


def _constant_column(target: RunColumn, value: float | str) -> pl.Expr:
    if target.stem in NAMES:
        return pl.lit(str(value)).alias(target.header)
    if isinstance(value, str):
        raise InputError(f"[constants] {target.header} = {value!r} is no number")
    return pl.lit(float(value)).alias(target.header)


def _numbers(trace: TraceMap) -> frozenset[str]:
    """Return the columns that hold numbers: none of names, and none of a clock."""
    plain = [name for name in trace.names if trace.column_of(name).stem not in NAMES]
    if trace.pattern is not None:
        return frozenset(plain)
    counts = [f"{name}/nanoseconds" for name in plain if trace.column(name).nanoseconds is not None]
    return frozenset([*(name for name in plain if trace.column(name).clock is None), *counts])


def _read_matches(file: str, lines: list[str], trace: TraceMap) -> tuple[RowSource, pl.DataFrame]:
    """Read the lines that the map's pattern matches."""
    pattern = regex.compile(trace.pattern or "")
    try:
        found = [(k, match) for k, line in enumerate(lines, 1) if (match := pattern.search(line, timeout=LINE_SECONDS))]
    except TimeoutError as err:
        raise InputError(
            f"{file}: the map's pattern {trace.pattern!r} needs over {LINE_SECONDS:g} s for a line: repeats in "
            "repeats, such as (a+)+, take endless time"
        ) from err
    if not found:
        raise InputError(f"{file}: no line of {len(lines)} matches the map's pattern {trace.pattern!r}")
    source = RowSource(file, np.array([number for number, _ in found]))
    text = pl.DataFrame({n: pl.Series([m[n] for _, m in found], dtype=pl.String) for n in trace.names})
    return source, numbers_in(text, source, _numbers(trace), trace.decimal)


def _read_separated_columns(file: str, lines: list[str], trace: TraceMap) -> tuple[RowSource, pl.DataFrame]:
    """Read separated columns by their position or by the text above them."""
    if trace.separator == " ":  # any number of blanks sets two fields apart
        lines = [re.sub(r"[ \t]+", " ", line.strip()) for line in lines]
    top = _first_row(file, lines, trace)
    fields = [field.strip().strip('"') for field in lines[top].split(trace.separator)]
    where: dict[int, str] = {}
    wanted = {name: trace.column(name).column for name in trace.names}
    wanted |= {f"{name}/{part}": c for name in trace.names for part, c in trace.column(name).parts.items()}
    for name, column in wanted.items():
        position = _position(name, column, fields, trace, f"(line {top + 1}: {lines[top]!r})", file)
        if position in where:
            raise InputError(f"{file}: the map takes column {position + 1} for more than one quantity")
        where[position] = name
    above = fields if trace.header else [str(i + 1) for i in range(len(fields))]
    headers = {called: above[p] for p, n in where.items() for called in (n, trace.column_of(n.partition("/")[0]).key)}
    source = RowSource.of_text(
        file, lines, top + trace.header + trace.unit_rows, len(fields), headers, trace.comment, trace.separator
    )
    names = [where.get(i, f"#{i + 1}") for i in range(len(fields))]
    source, frame = parse_rows(source, names, _numbers(trace), trace.decimal)
    return source, _with_clocks(source, frame, trace)


def _with_clocks(source: RowSource, frame: pl.DataFrame, trace: TraceMap) -> pl.DataFrame:
    """Return the table with the times of clocks and calendars in the unit of their quantity."""
    for name in trace.names:
        picked, text = trace.column(name), frame[name]
        if picked.clock is None:
            continue
        text = text if picked.date is None else frame[f"{name}/date"] + " " + text
        seconds = seconds_of(text.alias(name), picked.clock, source, name)
        frame = frame.with_columns((seconds / trace.column_of(name).factor).alias(name))
    return frame


def _first_row(file: str, lines: list[str], trace: TraceMap) -> int:
    """Return where the names of the columns stand, or the first row where there are none."""
    for number, line in enumerate(lines[trace.skip_rows :], start=trace.skip_rows):
        if line.strip() and not (trace.comment and line.startswith(trace.comment)):
            return number
    if not any(line.strip() for line in lines):
        raise InputError(f"{file}: is empty")
    below = f"below the {trace.skip_rows} lines that the map skips" if trace.skip_rows else "but blanks and comments"
    raise InputError(f"{file}: there is nothing {below}")


def _position(name: str, wanted: int | str, fields: list[str], trace: TraceMap, where: str, file: str) -> int:
    """Return which column of the trace (from 0) the map means by ``wanted`` for a quantity."""
    if isinstance(wanted, int):
        if 1 <= wanted <= len(fields):
            return wanted - 1
        there = f"there are columns 1 to {len(fields)} {where}"
        raise InputError(f"{file}: the map takes {name} from column {wanted}, but {there}")
    if not trace.header:
        says = "says header = false; give a position"
        raise InputError(f"{file}: the map takes {name} from column '{wanted}', but {says}")
    if wanted not in fields:
        found = ", ".join(f"'{field}'" for field in fields)
        hint = separator_hint(wanted, fields) or did_you_mean(wanted, fields)
        raise InputError(f"{file}: there is no column '{wanted}' for {name}{hint} (found: {found})")
    if fields.count(wanted) > 1:
        raise InputError(f"{file}: '{wanted}' stands above {fields.count(wanted)} columns; give {name} a position")
    return fields.index(wanted)


def _without_unwritten(table: RunTable) -> RunTable:
    """Leave out rows in which every axis is exactly 0: a list in a controller is declared so, then filled."""
    keys = [key for key in table.frame.columns if re.fullmatch(r"(q|cmd)\d+", key)]
    if not keys:
        return table
    written = np.flatnonzero(np.any(table.frame.select(keys).to_numpy() != 0.0, axis=1))
    lost = table.frame.height - len(written)
    if lost == 0:
        return table
    file = table.source.file
    if len(written) == 0:
        raise InputError(f"{file}: all {lost} rows hold 0 for every axis; the controller has not written them")
    source = table.source.take(written)
    said = f"{source.name}: {lost} rows hold 0 for every axis, so the controller never wrote them; they were left out"
    return replace(table, source=source, frame=table.frame[written], warnings=(*table.warnings, said))


UNSAID = (
    "the map does not say whose axes the angles are: they were taken for the joints of the model; "
    'axes_of = "model", or the language of the controller with robot = "NAME", says it'
)


def import_run(traces: Sequence[Path], map_file: Path) -> Run:
    """Return the run that ``traces`` hold, read by the column map (schema ``edbb-map/1``) in a file.

    Raises:
        InputError: the map or a trace is wrong, with file, line and column; or the robot's file does not say how the
            controller counts whose axes the angles are.
    """
    path = Path(map_file)
    mapping = read_toml(path, ColumnMap)
    robot: Robot | None = None
    needed = mapping.axes_of not in (None, MODEL)  # else the name may be that of any arm
    there = mapping.robot in list_robots() or (path.parent / str(mapping.robot)).exists()
    if mapping.robot is not None and (needed or there):
        robot = load_robot(mapping.robot, path.parent)
        mapping = mapping.model_copy(update={"robot": robot.name})
    run = import_by_map(traces, mapping, str(map_file), robot)
    unsaid = mapping.axes_of is None and mapping.n_joints > 0
    return replace(run, warnings=(*run.warnings, UNSAID)) if unsaid else run


def import_by_map(traces: Sequence[Path], mapping: ColumnMap, name: str, robot: Robot | None = None) -> Run:
    """Return the run that ``traces`` hold by a column map, which messages call ``name``.

    The map's top level reads the first trace, its ``[[traces]]`` the further ones in their order. A trace that the map
    says nothing of is read in the columns of a run. The gauge's trace and the controller's are joined by time, or pose
    by pose where they have no time. ``robot`` says how its controllers count, and readings are held against it.

    Raises:
        InputError: a trace is wrong, with file, line and column, or its readings stand in other rows than their angles.
    """
    if not traces:
        raise InputError(f"no trace was given; {name} reads {len(mapping.all_traces)}")
    if len(traces) < len(mapping.all_traces):
        raise InputError(f"{name} reads {len(mapping.all_traces)} traces, but {len(traces)} were given")
    said = {AXES_OF: mapping.axes_of, **{k: getattr(mapping, k) for k in ("measure", "robot", "plan_id", "angles")}}
    notes = {key: value for key, value in said.items() if value is not None}
    n_joints = mapping.n_joints
    mapped = [read_trace(Path(p), trace, notes) for p, trace in zip(traces, mapping.all_traces, strict=False)]
    tables = [*mapped, *(read_table(Path(path), n_joints or 16) for path in traces[len(mapped) :])]
    axes_of = None if robot is None else robot.axes_of
    whole = pair_tables([in_model_axes(table, axes_of) for table in tables], by_rows=mapping.join == "rows")
    if len(whole) > 1:
        files = ", ".join(t.source.file for t in whole)
        raise InputError(f"{files} are several runs, each whole; import them one by one")
    run = run_of(whole[0], n_joints or max(t.n_joints for t in tables))
    if robot is not None:
        refuse_shifted_rows(run, robot)
    return run
