"""A file of a run as a table in SI units, before it is known what was measured."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from planner.common.errors import InputError
from planner.common.units import Array
from planner.runs.columns import NAMES, WHOLE, RunColumn, recognise_columns, split_key
from planner.runs.text import (
    NOTES,
    RowSource,
    check_finite,
    check_text,
    check_whole,
    notes_in,
    parse_rows,
    read_bytes,
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
    units: tuple[tuple[str, str], ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def stem(self) -> str:
        """Return the file's name without its ending."""
        return Path(self.source.file).stem

    @property
    def n_joints(self) -> int:
        """Return the largest number of a joint that has an angle here, 0 where none has."""
        joints = (split_key(key) for key in self.frame.columns)
        return max((joint for stem, joint in joints if stem in ("q", "cmd")), default=0)

    def has(self, *keys: str) -> bool:
        """Return whether all these quantities are there."""
        return set(keys) <= set(self.frame.columns)

    def note(self, name: str) -> str | None:
        """Return what a comment line says of ``name``."""
        return dict(self.notes).get(name)

    def array(self, key: str) -> Array:
        """Return a column of numbers (n,)."""
        return self.frame[key].to_numpy().astype(float)

    def arrays(self, keys: Sequence[str]) -> Array:
        """Return several columns side by side (n, k)."""
        return np.ascontiguousarray(self.frame.select(keys).to_numpy(), dtype=float)


def read_table(path: Path, n_joints: int) -> RunTable:
    """Read a ``.csv`` or ``.parquet`` file in the columns of a run; which of them must be there is asked later.

    Raises:
        InputError: the file is missing, empty or ragged, a column has a wrong unit, a field is blank or no number.
    """
    if path.suffix.lower() == ".parquet":
        return _parquet(path, n_joints)
    data = read_bytes(path)
    check_text(data, str(path))
    head, headers, body = split_head(data)
    if not headers:
        raise InputError(f"{path}: the file is empty; a line with the names of the columns is expected")
    if len(headers) == 1 and (";" in headers[0] or "\t" in headers[0]):
        raise InputError(f"{path}: the columns are not separated by commas; bring the file in with 'edbb import'")
    columns, warnings = recognise_columns(headers, n_joints, str(path))
    source = RowSource(
        str(path),
        body,
        len(head) + 1,
        fields=len(headers),
        headers=tuple((c.key, c.header) for c in columns if c is not None),
    )
    numbers = frozenset(c.header for c in columns if c is not None and c.stem not in NAMES)
    names = _unique_names(headers)
    frame = parse_rows(source, names, numbers)
    return table_in_si(source, frame, [c for c in columns if c is not None], notes_in(head), warnings)


def table_in_si(
    source: RowSource,
    frame: pl.DataFrame,
    columns: list[RunColumn],
    notes: tuple[tuple[str, str], ...],
    warnings: list[str],
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
    for c in columns:
        if c.stem in WHOLE:
            check_whole(si[c.key], source, ALLOWED.get(c.stem, ()))
    return RunTable(source, si, tuple((c.key, c.unit) for c in columns), notes, tuple(warnings))


def _unique_names(headers: list[str]) -> list[str]:
    """Return headers with a number added to those that stand twice (none that a run knows does)."""
    return [h if headers.index(h) == i and h else f"{h}#{i + 1}" for i, h in enumerate(headers)]


def _parquet(path: Path, n_joints: int) -> RunTable:
    try:
        frame = pl.read_parquet(path)
        meta = pl.read_parquet_metadata(path)
    except (OSError, pl.exceptions.PolarsError) as err:
        raise InputError(f"{path}: cannot be read as Parquet ({str(err).splitlines()[0]})") from err
    columns, warnings = recognise_columns(frame.columns, n_joints, str(path))
    known = [c for c in columns if c is not None]
    source = RowSource(str(path), headers=tuple((c.key, c.header) for c in known))
    for c in known:
        wanted = pl.String if c.stem in NAMES else pl.Float64
        if wanted == pl.Float64 and not (frame.schema[c.header].is_numeric() or frame.schema[c.header] == pl.Boolean):
            raise InputError(f"{path}: the column '{c.header}' holds {frame.schema[c.header]}, not numbers")
        value = pl.col(c.header)
        if wanted == pl.String and frame.schema[c.header].is_float() and (frame[c.header] % 1.0 == 0.0).all():
            value = value.cast(pl.Int64)  # sockets numbered in floats are still called 1, 2
        frame = frame.with_columns(value.cast(wanted))
    notes = tuple((k, v) for k, v in sorted(meta.items()) if k in NOTES)
    return table_in_si(source, frame, known, notes, warnings)
