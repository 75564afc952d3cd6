"""A file of a run as a table in SI units, before it is known what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.common.files import check_readable
from planner.common.lazy_modules import pl
from planner.common.units import Array, read_only
from planner.runs.columns import NAMES, PLAUSIBLE, WHOLE, RunColumn, recognise_columns, spellings, split_key
from planner.runs.run import IntArray, index_names
from planner.runs.text import (
    NOTES,
    RowSource,
    check_finite,
    check_names,
    check_range,
    check_whole,
    notes_in,
    parse_rows,
    read_lines,
    split_head,
)

ALLOWED = {"direction": (-1, 0, 1), "sync": (0, 1)}
MAY_BE_BLANK = frozenset({"pose"})  # between two poses there is none


@dataclass(frozen=True)
class RunTable:
    """Columns in SI units under the names of their quantities (``q1``, ``length``, ``t``).

    Attributes:
        source: where the rows came from.
        frame: Float64 or text, no blanks but in ``pose``.
        units: the unit that each column was written in, by quantity.
        notes: what the comment lines say, by name.
        warnings: what a person should know.
    """

    source: RowSource
    frame: pl.DataFrame
    units: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def stem(self) -> str:
        """Return the file's name without its ending."""
        return Path(self.source.file).stem

    @property
    def n_joints(self) -> int:
        """Return the largest number of a joint that has an angle here, 0 where none has."""
        joints = (split_key(key) for key in self.frame.columns)
        return max((joint for stem, joint in joints if stem in ("q", "cmd")), default=0)

    def has(self, key: str) -> bool:
        """Return whether this quantity is there."""
        return key in self.frame.columns

    def array(self, key: str) -> Array:
        """Return a column of numbers (n,)."""
        return self.frame[key].to_numpy().astype(float)

    def optional(self, key: str) -> Array | None:
        """Return a column of numbers (n,), read-only, or None where it is not there."""
        return read_only(self.array(key)) if self.has(key) else None

    def group(self, keys: Sequence[str], lacking: str) -> Array | None:
        """Return columns that belong together (n, k), read-only, or None where none of them is there.

        Raises:
            InputError: ``lacking``, with the names of the columns, where only some are there.
        """
        missing = [key for key in keys if not self.has(key)]
        if len(missing) == len(keys):
            return None
        if missing:
            raise InputError(f"{self.source.file}: {lacking.format(', '.join(spellings(key) for key in missing))}")
        return read_only(np.ascontiguousarray(self.frame.select(keys).to_numpy()))

    def joints(self, stem: str, n_joints: int) -> Array | None:
        """Return a quantity of the joints (n, N), read-only, or None.

        Raises:
            InputError: some joints have it and some have not.
        """
        keys = [f"{stem}{joint}" for joint in range(1, n_joints + 1)]
        return self.group(keys, f"the robot has {n_joints} joints, but there is no column {{}}")

    def names(self, key: str, otherwise: str = "") -> tuple[IntArray, tuple[str, ...]]:
        """Return a column of names as indices (n,) into them, and these; one for all where it is not there."""
        return index_names(self.frame[key].to_list() if self.has(key) else [otherwise] * self.frame.height)


def read_table(path: Path, n_joints: int) -> RunTable:
    """Read a ``.csv`` or ``.parquet`` file in the columns of a run; which of them must be there is asked later.

    Raises:
        InputError: the file is missing, empty or ragged, a column has a wrong unit, a field is blank or no number.
    """
    if path.suffix.lower() == ".parquet":
        return _read_parquet(path, n_joints)
    lines = read_lines(path)
    head, headers = split_head(lines)
    if not headers:
        raise InputError(f"{path}: the file is empty; a line with the names of the columns is expected")
    if len(headers) == 1 and (";" in headers[0] or "\t" in headers[0]):
        raise InputError(f"{path}: the columns are not separated by commas; bring the file in with 'edbb import'")
    columns, warnings = recognise_columns(headers, n_joints, str(path))
    source = RowSource.of_text(
        str(path), lines, len(head) + 1, len(headers), {c.key: c.header for c in columns.values()}
    )
    numbers = frozenset(c.header for c in columns.values() if c.stem not in NAMES)
    unique = [h if headers.index(h) == i and h else f"{h}#{i + 1}" for i, h in enumerate(headers)]
    source, frame = parse_rows(source, unique, numbers)
    return table_in_si(source, frame, list(columns.values()), notes_in(head), warnings)


def table_in_si(
    source: RowSource,
    frame: pl.DataFrame,
    columns: Sequence[RunColumn],
    notes: Mapping[str, str],
    warnings: Sequence[str] = (),
) -> RunTable:
    """Return the table of ``columns`` in SI units, checked for blanks and numbers that are none.

    Raises:
        InputError: there is no row, or a field is blank or not finite.
    """
    if frame.height == 0:
        raise InputError(f"{source.file}: there is no row below the names of the columns")
    si = frame.select(
        (pl.col(c.header) if c.factor == 1.0 else pl.col(c.header) * c.factor).alias(c.key) for c in columns
    )
    check_finite(si, source, MAY_BE_BLANK)
    check_range(si, source, {c.key: PLAUSIBLE[c.stem] for c in columns if c.stem in PLAUSIBLE})
    for c in columns:
        if c.stem in NAMES:
            check_names(si[c.key], source)
        if c.stem in WHOLE:
            check_whole(si[c.key], source, ALLOWED.get(c.stem, ()))
    return RunTable(source, si, {c.key: c.unit for c in columns}, notes, tuple(warnings))


MOST_PARQUET, MOST_FIELDS = 500_000_000, 60_000_000  # bytes of a file, and fields in it: 1.7 GB while they are read


def _read_parquet(path: Path, n_joints: int) -> RunTable:
    check_readable(path, MOST_PARQUET)
    try:
        lazy = pl.scan_parquet(path)
        rows, width = lazy.select(pl.len()).collect().item(), len(lazy.collect_schema())
        if rows * width > MOST_FIELDS:  # a few bytes can say a thousand million equal rows
            raise InputError(f"{path}: {rows} rows of {width} columns are more than any run has")
        frame = lazy.collect()
        meta = pl.read_parquet_metadata(path)
    except (OSError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as err:
        raise InputError(f"{path}: cannot be read as Parquet ({(str(err).splitlines() or ['empty'])[0]})") from err
    columns, warnings = recognise_columns(frame.columns, n_joints, str(path))
    known = list(columns.values())
    source = RowSource(str(path), np.arange(1, frame.height + 1), headers={c.key: c.header for c in known})
    for c in known:
        wanted = pl.String if c.stem in NAMES else pl.Float64
        switch = ALLOWED.get(c.stem) == (0, 1) and frame.schema[c.header] == pl.Boolean
        if wanted == pl.Float64 and not (frame.schema[c.header].is_numeric() or switch):
            raise InputError(f"{path}: the column '{c.header}' holds {frame.schema[c.header]}, not numbers")
        if frame.schema[c.header].is_nested() or frame.schema[c.header] == pl.Binary:
            raise InputError(f"{path}: the column '{c.header}' holds {frame.schema[c.header]}, not names")
        value = pl.col(c.header)
        if wanted == pl.String and frame.schema[c.header].is_float() and (frame[c.header] % 1.0 == 0.0).all():
            value = value.cast(pl.Int64)  # sockets numbered in floats are still called 1, 2
        frame = frame.with_columns(value.cast(wanted))
    notes = {key: value for key, value in sorted(meta.items()) if key in NOTES}
    return table_in_si(source, frame, known, notes, warnings)
