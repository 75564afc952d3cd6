"""The text of a run's file: the lines above its columns, its rows as numbers and names, and where each row stands."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError, is_printable_line
from planner.common.files import UTF_16_MARKS, announced_encoding, read_bytes
from planner.common.lazy_modules import pl
from planner.common.remarks import CELL_ENDS, remark_of
from planner.common.schema import MOST_NAME
from planner.common.units import IntArray
from planner.runs.mat_files import mat_lines

NOTES = ("plan_id", "robot", "measure", "angles", "clocks", "truth")  # what comment lines may say


@dataclass(frozen=True)
class RowSource:
    """A file and where the rows of a table stand in it, so that a message can name file, line and column.

    Attributes:
        file: its path as the person gave it.
        lines: number of each row's line (of its row in a Parquet file), from 1.
        texts: each row as written; empty where the file has no text.
        separator: between fields.
        columns: how many columns the text has.
        headers: what the file calls a column, by quantity and by what a map calls it.
    """

    file: str
    lines: IntArray
    texts: Sequence[str] = ()
    separator: str = ","
    columns: int = 0
    headers: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of_text(
        cls,
        file: str,
        lines: Sequence[str],
        skip: int,
        columns: int,
        headers: Mapping[str, str],
        comment: str = "#",
        separator: str = ",",
    ) -> RowSource:
        """Return the rows of a text: its lines after the first ``skip``, without blanks and comments."""
        rows = [
            (number, line)
            for number, line in enumerate(lines[skip:], start=skip + 1)
            if line.strip() and not (comment and line.startswith(comment))
        ]
        numbers = np.array([number for number, _ in rows], dtype=np.int64)
        return cls(file, numbers, [line for _, line in rows], separator, columns, headers)

    @property
    def name(self) -> str:
        """Return the file's name without its folders, for what is written into results."""
        return Path(self.file).name

    def at(self, row: int) -> str:
        """Return ``"run.csv, line 12"`` for row 0, 1, …"""
        return f"{self.file}, {'row' if self.file.lower().endswith('.parquet') else 'line'} {self.lines[row]}"

    def take(self, rows: IntArray) -> RowSource:
        """Return the source of the rows at ``rows`` alone."""
        return replace(self, lines=self.lines[rows], texts=[self.texts[i] for i in rows] if self.texts else ())

    def error(self, row: int, key: str, found: str) -> InputError:
        """Return what is wrong with quantity ``key`` of a row, with file, line and column."""
        return InputError(f"{self.at(row)}, column '{self.headers.get(key, key)}': {found}")

    def fields(self, row: int) -> int:
        """Return how many fields a row has, 0 where the file has no text."""
        try:
            return len(next(csv.reader([self.texts[row]], delimiter=self.separator))) if self.texts else 0
        except csv.Error as err:
            raise InputError(f"{self.at(row)}: cannot be read ({err})") from err


def read_lines(path: Path, encoding: str | None = None) -> list[str]:
    """Return the lines of a file, in UTF-8 or as a map says; of a .mat file those of a table of its arrays.

    Raises:
        InputError: it cannot be read, or is in another encoding.
    """
    if path.suffix.lower() == ".mat":
        return mat_lines(path)
    most_bytes = 250_000_000  # of a run's or trace's text: 1.7 GB while they are read
    data = read_bytes(path, most_bytes, "leave out samples, or write it as Parquet").removeprefix(b"\xef\xbb\xbf")
    hint = _encoding_hint(data)
    try:
        text = data.decode(encoding or announced_encoding(data)).removeprefix("\ufeff")
        if "\0" in text[:64]:
            raise UnicodeError("it has letters of the number 0")
    except UnicodeError as err:
        if encoding is not None:
            raise InputError(f"{path}: the text is not {encoding}, as the map says ({err}){hint}") from err
        line = data.count(b"\n", 0, err.start if isinstance(err, UnicodeDecodeError) else 0) + 1
        raise InputError(
            f"{path}, line {line}: the text is not UTF-8; name its encoding in a map of 'edbb import'{hint}"
        ) from err
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _encoding_hint(data: bytes) -> str:
    """Return which encoding a file announces, or its first letters show."""
    if data.startswith(UTF_16_MARKS):
        return '; it begins as UTF-16 does: encoding = "utf-16" in its map'
    start = data[:64]
    order = "le" if start[1::2].count(0) > start[::2].count(0) else "be"
    return f'; every other byte is 0, as in UTF-16: encoding = "utf-16-{order}" in its map' if 0 in start else ""


def separator_hint(wanted: str, fields: Sequence[str]) -> str:
    """Return what a map would have to say where the one column that was found holds several by another sign."""
    signs = {";": ";", "\t": "\\t", ",": ",", " ": " "}  # and how a map writes them
    parted = (shown for sign, shown in signs.items() if wanted in (part.strip() for part in fields[0].split(sign)))
    sign = next(parted, None) if len(fields) == 1 else None
    return "" if sign is None else f'; separator = "{sign}" for this trace in the map parts the line'


def split_head(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the lines before the names of the columns, and these names (none where the file is empty)."""
    head: list[str] = []
    for line in lines:
        remark = remark_of(line)
        if line.strip() and remark is None:
            return head, [name.strip().strip('"') for name in line.strip().split(",")]
        head.append("" if remark is None else f"# {remark}")
    return head, []


def notes_in(lines: Sequence[str]) -> dict[str, str]:
    """Return what lines such as ``# plan_id: 0123456789ab`` say."""
    pairs = (remark.partition(":") for line in lines if (remark := remark_of(line)) is not None)
    return {key.strip(): value.strip(CELL_ENDS) for key, colon, value in pairs if colon and key.strip() in NOTES}


def parse_rows(
    source: RowSource, names: Sequence[str], numbers: frozenset[str], decimal: str = "."
) -> tuple[RowSource, pl.DataFrame]:
    """Return the rows of a text: Float64 for the columns in ``numbers``, text for the others, null for a blank.

    Raises:
        InputError: a ragged row, or a field that is no number.
    """
    try:
        text = pl.read_csv(
            io.BytesIO("\n".join(source.texts).encode()),
            has_header=False,
            schema={name: pl.String for name in names},
            separator=source.separator,
        )
    except pl.exceptions.NoDataError:
        text = pl.DataFrame(schema={name: pl.String for name in names})
    except (pl.exceptions.ComputeError, pl.exceptions.SchemaError) as err:
        raise _ragged_row_error(source) from err
    if text.height < len(source.lines):  # a quoted field goes on over several lines
        open_quotes = np.cumsum([row.count('"') for row in source.texts]) % 2
        source = source.take(np.flatnonzero(np.append(0, open_quotes[:-1]) == 0)[: text.height])
    return source, numbers_in(text, source, numbers, decimal)


def numbers_in(text: pl.DataFrame, source: RowSource, numbers: frozenset[str], decimal: str) -> pl.DataFrame:
    """Return a table of text with numbers in the columns ``numbers``, spaces around them forgiven.

    Raises:
        InputError: a field is no number.
    """
    stripped = pl.col(pl.String).str.strip_chars()
    text = text.with_columns(pl.when(stripped != "").then(stripped).name.keep())
    hint = "" if decimal == "." else f" (the decimal sign is '{decimal}')"
    for name in (n for n in text.columns if n in numbers):
        field = text[name]
        if decimal != ".":  # a point is then no decimal sign, and might group thousands
            field = field.str.replace(".", "point", literal=True).str.replace(decimal, ".", literal=True)
        value = field.cast(pl.Float64, strict=False)
        if name == "pose" and value.null_count() > field.null_count():
            numbered = number_labels(field)
            value = value if numbered is None else numbered
        if (row := first_row(value.is_null() & field.is_not_null())) is not None:
            hint = " (poses are numbered, or called like P1 or A1, B1)" if name == "pose" else hint
            raise source.error(row, name, f"{text[name][row]!r} is no number{hint}")
        text = text.with_columns(value.alias(name))
    return text


def number_labels(labels: pl.Series) -> pl.Series | None:
    """Return numbers (n,) for labels of poses such as ``P12``, or ``A1`` and ``B1``, blanks kept; ``None`` for others.

    With one beginning it is the number behind it; with several, of one or two letters, these count ten thousands.
    """
    parts = labels.str.to_uppercase().str.extract_groups(r"^(?<begin>.*?)(?<number>[0-9]{1,4})$").struct.unnest()
    begins = sorted(parts["begin"].drop_nulls().unique())
    if (parts["number"].is_null() & labels.is_not_null()).any():
        return None
    if len(begins) == 1:
        return parts["number"].cast(pl.Float64)
    if not all(re.fullmatch("[A-Z]{0,2}", begin) for begin in begins):
        return None
    thousands = {begin: 1e4 * sum((ord(c) - 64) * 27**k for k, c in enumerate(begin[::-1])) for begin in begins}
    return parts["number"].cast(pl.Float64) + parts["begin"].replace_strict(thousands, return_dtype=pl.Float64)


def first_row(wrong: pl.Series | np.ndarray) -> int | None:
    """Return the first row in which ``wrong`` (n,) holds, if any."""
    rows = np.flatnonzero(np.asarray(wrong))
    return int(rows[0]) if len(rows) else None


def _ragged_row_error(source: RowSource) -> InputError:
    for row in range(len(source.lines)):
        if (found := source.fields(row)) > source.columns:
            commas = found >= 2 * source.columns - 1 and source.separator == ","  # each number, or all but one, is two
            hint = "; if the commas are decimal ones, save with ';' between the columns, or with points" * commas
            return InputError(f"{source.at(row)}: there are {found} fields, but {source.columns} columns{hint}")
    return InputError(f"{source.file}: the rows cannot be read; a field or a quotation mark does not end")


def check_finite(frame: pl.DataFrame, source: RowSource, may_be_blank: frozenset[str]) -> None:
    """Check that every number is finite and no field is blank, but in the columns that ``may_be_blank``.

    Raises:
        InputError: with file, line and column of the first one that is not.
    """
    for name in frame.columns:
        values = frame[name]
        wrong = values.is_null() if name not in may_be_blank else pl.zeros(len(values), dtype=pl.Boolean, eager=True)
        if values.dtype == pl.Float64:
            wrong = wrong | values.is_not_null() & values.is_finite().not_().fill_null(False)
        if (row := first_row(wrong)) is not None:
            found = "the field is blank" if values[row] is None else f"{values[row]} is no finite number"
            fields = source.fields(row)
            short = f" (the line has {fields} fields of {source.columns})" if 0 < fields < source.columns else ""
            raise source.error(row, name, f"{found}{short}")


def check_range(
    frame: pl.DataFrame,
    source: RowSource,
    ranges: Mapping[str, tuple[float, float]],
    units: Mapping[str, tuple[str, float]],
) -> None:
    """Check that the numbers of columns lie within what any cell can have.

    Args:
        frame: columns in SI units.
        source: of the rows.
        ranges: lowest and highest of each column that has them, in SI units.
        units: each column's unit as written, and its factor to SI.

    Raises:
        InputError: with file, line and column of the first one that does not.
    """
    for name, (low, high) in ranges.items():
        values = frame[name]
        row = first_row(values.is_between(low, high).not_().fill_null(False)) if values.dtype.is_numeric() else None
        if row is not None:
            unit, factor = units[name]
            found, least, most = (f"{v / factor:g} {unit}".rstrip() for v in (values[row], low, high))
            hint = "; is it the unit of the numbers?" if unit else ""
            raise source.error(row, name, f"{found} lies outside of {least} to {most}{hint}")


def drop_lost_positions(source: RowSource, frame: pl.DataFrame) -> tuple[RowSource, pl.DataFrame, list[str]]:
    """Return the rows but those at 0, 0, 0, and a warning of them: a tracker without its reflector logs that.

    Raises:
        InputError: there is no other row.
    """
    axes = ("x", "y", "z")
    if not set(axes) <= set(frame.columns):
        return source, frame, []
    lost = (frame.select(axes).to_numpy() == 0.0).all(axis=1)
    rows, kept = np.flatnonzero(lost), np.flatnonzero(~lost)
    if len(rows) == 0:
        return source, frame, []
    why = "the tracker had lost its reflector (the beam was broken, or no reflector was in the nest)"
    if len(kept) == 0:
        raise InputError(f"{source.file}: every position is 0, 0, 0: {why}")
    named = ", ".join(source.at(int(row)).rpartition(", ")[2] for row in rows[:3])
    more = f" and {len(rows) - 3} more" if len(rows) > 3 else ""
    warning = f"{source.name}: the position is 0, 0, 0 in {named}{more}: {why}; cut out: measure these again"
    return source.take(kept), frame[kept], [warning]


def check_names(names: pl.Series, source: RowSource) -> None:
    """Check that a column holds names on one line that are no paths.

    Raises:
        InputError: with file, line and column of the first one that is not.
    """
    for name in names.unique(maintain_order=True):
        path = name.startswith(("/", "~")) or "\\" in name or ".." in name.split("/")
        if path or len(name) > MOST_NAME or not is_printable_line(name):
            row = first_row(names == name)
            assert row is not None
            allowed = f"at most {MOST_NAME} letters, digits and signs on one line, and no path, are allowed"
            raise source.error(row, names.name, f"{name!r} is no name: {allowed}")


def check_whole(values: pl.Series, source: RowSource, allowed: Sequence[int] = ()) -> None:
    """Check that a column holds whole numbers (of ``allowed``, where given), or blanks.

    Raises:
        InputError: with file, line and column of the first one that is not.
    """
    wrong = (values != values.round()).fill_null(False)
    if allowed:
        wrong = wrong | values.is_in([float(a) for a in allowed]).not_().fill_null(False)
    if (row := first_row(wrong)) is not None:
        what = f"none of {', '.join(map(str, allowed))}" if allowed else "no whole number"
        raise source.error(row, values.name, f"{values[row]:g} is {what}")
