"""Traces of controllers and gauges brought into one run by a column map."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from planner.common.errors import InputError, did_you_mean
from planner.common.schema import read_toml
from planner.common.units import Array
from planner.runs.column_map import ColumnMap, TraceMap
from planner.runs.columns import NAMES, RunColumn
from planner.runs.loader import run_of
from planner.runs.run import Run
from planner.runs.synchronisation import pair_tables
from planner.runs.table import RunTable, read_table, table_in_si
from planner.runs.text import RowSource, numbers_in, parse_rows, read_bytes

PLAN_ID = re.compile(r"plan_id\W+([0-9a-f]{12})\b")


@dataclass(frozen=True)
class _TraceText:
    """A trace as text: its lines, and how many of them stand before the rows."""

    file: str
    lines: list[str]
    skipped: int
    headers: list[str]


def read_trace(path: Path, trace: TraceMap, notes: tuple[tuple[str, str], ...] = ()) -> RunTable:
    """Read a trace through its map.

    Raises:
        InputError: the file does not have what the map says, or a field is no number; with line and column.
    """
    try:
        text = read_bytes(path).decode(trace.encoding).removeprefix("\ufeff")
    except UnicodeError as err:
        raise InputError(f"{path}: the text is not {trace.encoding}, as the map says ({err})") from err
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    plan = PLAN_ID.search(text)
    notes = notes if plan is None or "plan_id" in dict(notes) else (*notes, ("plan_id", plan[1]))
    source, frame = (
        _read_matches(str(path), lines, trace) if trace.pattern else _read_separated(str(path), lines, trace)
    )
    columns = [trace.column_of(name) for name in trace.names]
    frame = frame.select(
        _scaled_column(name, c, trace).alias(c.header) for name, c in zip(trace.names, columns, strict=True)
    )
    constants = [trace.column_of(name) for name in trace.constants]
    frame = frame.with_columns(_constant(c, v) for c, v in zip(constants, trace.constants.values(), strict=True))
    table = table_in_si(source, frame, [*columns, *constants], notes, [])
    return _without_unwritten(table) if trace.pattern else table


def _scaled_column(name: str, target: RunColumn, trace: TraceMap) -> pl.Expr:
    if trace.pattern is not None or target.stem in NAMES:
        return pl.col(name)
    picked = trace.picked(name)
    value = pl.col(name) if picked.factor == 1.0 else pl.col(name) * picked.factor
    return value if picked.offset == 0.0 else value + picked.offset


def _constant(target: RunColumn, value: float | str) -> pl.Expr:
    if target.stem in NAMES:
        return pl.lit(str(value)).alias(target.header)
    if isinstance(value, str):
        raise InputError(f"[constants] {target.header} = {value!r} is no number")
    return pl.lit(float(value)).alias(target.header)


def _numbers(trace: TraceMap) -> frozenset[str]:
    return frozenset(name for name in trace.names if trace.column_of(name).stem not in NAMES)


def _read_matches(file: str, lines: list[str], trace: TraceMap) -> tuple[RowSource, pl.DataFrame]:
    """Read the lines that the map's pattern matches."""
    found = [(number, match) for number, line in enumerate(lines, 1) if (match := re.search(trace.pattern or "", line))]
    if not found:
        raise InputError(f"{file}: no line of {len(lines)} matches the map's pattern {trace.pattern!r}")
    source = RowSource(file, lines=np.array([number for number, _ in found]))
    text = pl.DataFrame({n: pl.Series([m[n] for _, m in found], dtype=pl.String) for n in trace.names})
    return source, numbers_in(text, source, _numbers(trace), trace.decimal)


def _read_separated(file: str, lines: list[str], trace: TraceMap) -> tuple[RowSource, pl.DataFrame]:
    """Read separated columns by their position or by the text above them."""
    text = _find_header(file, lines, trace)
    where = {name: _position(text, name, trace) for name in trace.names}
    by_position = {position: name for name, position in where.items()}
    if len(by_position) < len(where):
        twice = next(p for p in by_position if list(where.values()).count(p) > 1)
        raise InputError(f"{file}: the map takes column {twice + 1} for more than one quantity")
    names = [by_position.get(i, f"#{i + 1}") for i in range(len(text.headers))]
    body = "\n".join(_single_blanks(line, trace) for line in lines[text.skipped :]).encode()
    above = [(called, text.headers[p]) for n, p in where.items() for called in (n, trace.column_of(n).key)]
    source = RowSource(
        file, body, text.skipped, trace.comment, trace.separator, fields=len(names), headers=tuple(above)
    )
    return source, parse_rows(source, names, _numbers(trace), trace.decimal)


def _find_header(file: str, lines: list[str], trace: TraceMap) -> _TraceText:
    """Find the names of the columns, or count the columns of the first row where there are none."""
    for number, line in enumerate(lines[trace.skip_rows :], start=trace.skip_rows):
        if not line.strip() or (trace.comment and line.startswith(trace.comment)):
            continue
        fields = [field.strip().strip('"') for field in _single_blanks(line, trace).split(trace.separator)]
        if trace.header:
            return _TraceText(file, lines, number + 1, fields)
        return _TraceText(file, lines, number, [str(i + 1) for i in range(len(fields))])
    below = f"below the {trace.skip_rows} lines that the map skips" if trace.skip_rows else "but blanks and comments"
    raise InputError(
        f"{file}: there is nothing {below}" if any(line.strip() for line in lines) else f"{file}: is empty"
    )


def _single_blanks(line: str, trace: TraceMap) -> str:
    """Return the line with one blank between fields where these are set apart by any number of them."""
    return re.sub(r"[ \t]+", " ", line.strip()) if trace.separator == " " else line


def _position(text: _TraceText, name: str, trace: TraceMap) -> int:
    """Return which column of the trace (from 0) the map means."""
    wanted = trace.picked(name).column
    if isinstance(wanted, int):
        if 1 <= wanted <= len(text.headers):
            return wanted - 1
        raise InputError(
            f"{text.file}: the map takes {name} from column {wanted}, but there are columns 1 to {len(text.headers)} "
            f"(line {text.skipped + 1 - trace.header}: {text.lines[text.skipped - trace.header]!r})"
        )
    if not trace.header:
        raise InputError(
            f"{text.file}: the map takes {name} from column '{wanted}', but says header = false; give a position"
        )
    if wanted not in text.headers:
        found = ", ".join(f"'{h}'" for h in text.headers)
        raise InputError(
            f"{text.file}: there is no column '{wanted}' for {name}{did_you_mean(wanted, text.headers)} (found:"
            f" {found})"
        )
    if text.headers.count(wanted) > 1:
        raise InputError(
            f"{text.file}: '{wanted}' stands above {text.headers.count(wanted)} columns; give {name} a position"
        )
    return text.headers.index(wanted)


def _without_unwritten(table: RunTable) -> RunTable:
    """Leave out rows in which every axis is exactly 0: a list in a controller is declared so, then filled."""
    keys = [key for key in table.frame.columns if re.fullmatch(r"(q|cmd)\d+", key)]
    if not keys:
        return table
    angles: Array = table.arrays(keys)
    written = np.flatnonzero(np.any(angles != 0.0, axis=1))
    lost = table.frame.height - len(written)
    if lost == 0:
        return table
    file = table.source.file
    if len(written) == 0:
        raise InputError(f"{file}: all {lost} rows hold 0 for every axis; the controller has not written them")
    source = RowSource(file, lines=table.source.lines[written] if table.source.lines is not None else None)
    said = f"{source.name}: {lost} rows hold 0 for every axis, so the controller never wrote them; they were left out"
    return RunTable(source, table.frame[written], table.units, table.notes, (*table.warnings, said))


def import_run(traces: Sequence[Path], map_file: Path) -> Run:
    """Return the run that ``traces`` hold, read by the column map (schema ``edbb-map/1``).

    The map's top level reads the first trace, its ``[[traces]]`` the further ones in their order; a trace that the map
    says nothing of is read in the columns of a run. The gauge's trace and the controller's are joined by time, or pose
    by pose where they have no time.

    Raises:
        InputError: the map or a trace is wrong, with file, line and column.
    """
    mapping = read_toml(Path(map_file), ColumnMap)
    if not traces:
        raise InputError(f"no trace was given; {map_file} reads {len(mapping.all_traces)}")
    if len(traces) < len(mapping.all_traces):
        raise InputError(f"{map_file} reads {len(mapping.all_traces)} traces, but {len(traces)} were given")
    said = (("measure", mapping.measure), ("robot", mapping.robot), ("plan_id", mapping.plan_id))
    notes = tuple((key, value) for key, value in said if value is not None)
    n_joints = mapping.n_joints
    tables: list[RunTable] = []
    for i, path in enumerate(traces):
        known = i < len(mapping.all_traces)
        tables.append(
            read_trace(Path(path), mapping.all_traces[i], notes) if known else read_table(Path(path), n_joints or 16)
        )
    whole = pair_tables(tables)
    if len(whole) > 1:
        files = ", ".join(t.source.file for t in whole)
        raise InputError(f"{files} are several runs, each whole; import them one by one")
    return run_of(whole[0], n_joints or max(t.n_joints for t in tables))
