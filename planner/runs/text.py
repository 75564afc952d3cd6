"""The text of a run's file: its head, its rows as numbers and names, and where each row came from."""

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from planner.common.errors import InputError
from planner.runs.run import IntArray

NOTES = ("plan_id", "robot", "measure", "angles", "clocks")  # what comment lines may say


def read_bytes(path: Path) -> bytes:
    """Return what the file holds, without a byte order mark.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err


def check_text(data: bytes, file: str) -> None:
    """Check that ``data`` is text.

    Raises:
        InputError: with the line that is not.
    """
    if data.isascii():
        return
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as err:
        line = data.count(b"\n", 0, err.start) + 1
        raise InputError(
            f"{file}, line {line}: the text is not UTF-8; name its encoding in a map of 'edbb import'"
        ) from err


def split_head(data: bytes) -> tuple[list[str], list[str], bytes]:
    """Return the lines before the names of the columns, these names, and the rows below."""
    head: list[str] = []
    start = 0
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        text = data[start:end].decode("utf-8").strip()
        start = end + 1
        if text and not text.startswith("#"):
            return head, [h.strip().strip('"') for h in text.split(",")], data[start:]
        head.append(text)
    return head, [], b""


def notes_in(lines: list[str]) -> tuple[tuple[str, str], ...]:
    """Return what lines such as ``# plan_id: 0123456789ab`` say."""
    pairs = (line.lstrip("# \t").partition(":") for line in lines if line.startswith("#"))
    return tuple((key.strip(), value.strip()) for key, colon, value in pairs if colon and key.strip() in NOTES)


@dataclass(frozen=True)
class RowSource:
    """A file and how its rows lie in it.

    Attributes:
        file: its path as the person gave it.
        body: the text from the first row on, as read; ``None`` where the file has no lines (Parquet).
        skipped: lines before ``body``.
        comment: how a comment line begins; empty where there are none.
        separator: between fields.
        lines: number of the line of each row of the file, where it is not just counted.
        rows: row of the file that each row of the table is, where some were left out.
        fields: number of columns, 0 where lines are not told by it.
        headers: what the file calls a column, by quantity and by what a map calls it.
    """

    file: str
    body: bytes | None = None
    skipped: int = 0
    comment: str = "#"
    separator: str = ","
    lines: IntArray | None = None
    rows: IntArray | None = None
    fields: int = 0
    headers: tuple[tuple[str, str], ...] = field(default=())

    @property
    def name(self) -> str:
        """Return the file's name without its folders, for what is written into results."""
        return Path(self.file).name

    def at(self, row: int) -> str:
        """Return ``"run.csv, line 12"`` for row 0, 1, …"""
        row = row if self.rows is None else int(self.rows[row])
        if self.lines is not None:
            return f"{self.file}, line {self.lines[row]}"
        if self.body is None:
            return f"{self.file}, row {row + 1}"
        return f"{self.file}, line {self.line_and_text(row)[0]}"

    def line_and_text(self, row: int) -> tuple[int, str]:
        """Return the number of a row's line and its text."""
        seen = -1
        for number, line in enumerate((self.body or b"").split(b"\n"), start=self.skipped + 1):
            seen += self.is_row(line)
            if seen == row:
                return number, line.decode("utf-8", "replace").rstrip("\r")
        raise IndexError(row)

    def numbers(self, n: int) -> IntArray:
        """Return the line of each row of the table (n,), as :meth:`at` says it for one."""
        every = self._numbers(n if self.rows is None else int(self.rows.max(initial=-1)) + 1)
        return every if self.rows is None else np.asarray(every[self.rows])

    def _numbers(self, n: int) -> IntArray:
        """Return the line of each of the first n rows of the file (n,)."""
        if self.lines is not None:
            return self.lines[:n]
        body = self.body or b""
        if body.count(b"\n") + (not body.endswith(b"\n")) == n:  # a line for each row
            return np.arange(self.skipped + 1, self.skipped + 1 + n)
        if self.body is None:
            return np.arange(1, n + 1)
        lines = enumerate(body.split(b"\n"), start=self.skipped + 1)
        return np.array([number for number, line in lines if self.is_row(line)], dtype=np.int64)[:n]

    def is_row(self, line: bytes) -> bool:
        """Return whether a line of the body is neither blank nor a comment."""
        return not (is_blank(line) or (self.comment and line.startswith(self.comment.encode())))

    def header(self, key: str) -> str:
        """Return what the file calls a quantity."""
        return dict(self.headers).get(key, key)


def is_blank(line: bytes) -> bool:
    """Return whether a line holds nothing."""
    return not line.strip()


def without_blank_lines(body: bytes) -> bytes:
    """Return the text without its empty lines."""
    if not any(mark in body for mark in (b"\n\n", b"\n\r\n", b"\n ", b"\n\t")) and not is_blank(body[:1]):
        return body
    return b"\n".join(line for line in body.split(b"\n") if not is_blank(line))


Schema = Mapping[str, pl.DataType | type[pl.DataType]]


def parse_rows(source: RowSource, headers: Sequence[str], numbers: frozenset[str], decimal: str = ".") -> pl.DataFrame:
    """Return the rows of ``source.body``: Float64 for the columns in ``numbers``, text for the others.

    Numbers are finite and there are no blanks among them, except as null in columns that may have some
    (`finite` looks at that later).

    Raises:
        InputError: a ragged row, or a field that is no number.
    """
    body = without_blank_lines(source.body or b"")
    if decimal == ".":
        schema: Schema = {h: pl.Float64 if h in numbers else pl.String for h in headers}
        with suppress(pl.exceptions.ComputeError):
            return _strip_text(_read(body, source, schema))
    try:
        text = _read(body, source, {h: pl.String for h in headers})
    except pl.exceptions.ComputeError as err:
        raise _ragged_row_error(source, len(headers)) from err
    return numbers_in(text, source, numbers, decimal)


def _read(body: bytes, source: RowSource, schema: Schema) -> pl.DataFrame:
    return pl.read_csv(
        io.BytesIO(body),
        has_header=False,
        schema=schema,
        separator=source.separator,
        comment_prefix=source.comment or None,
    )


def _strip_text(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the table with the spaces around texts taken off, and null where nothing is left."""
    text = pl.col(pl.String).str.strip_chars()
    return frame.with_columns(pl.when(text != "").then(text).name.keep())


def numbers_in(text: pl.DataFrame, source: RowSource, numbers: frozenset[str], decimal: str) -> pl.DataFrame:
    """Return a table of text with numbers in the columns ``numbers``, spaces around them forgiven.

    Raises:
        InputError: a field is no number.
    """
    text = _strip_text(text)
    hint = "" if decimal == "." else f" (the decimal sign is '{decimal}')"
    for name in (n for n in text.columns if n in numbers):
        field = text[name]
        if decimal != ".":  # a point is then no decimal sign, and might group thousands
            field = field.str.replace(".", "point", literal=True).str.replace(decimal, ".", literal=True)
        value = field.cast(pl.Float64, strict=False)
        wrong = (value.is_null() & field.is_not_null()).to_numpy()
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(
                f"{source.at(row)}, column '{source.header(name)}': {text[name][row]!r} is no number{hint}"
            )
        text = text.with_columns(value.alias(name))
    return text


def _ragged_row_error(source: RowSource, fields: int) -> InputError:
    for number, line in enumerate((source.body or b"").split(b"\n"), start=source.skipped + 1):
        if not source.is_row(line):
            continue
        found = len(next(csv.reader([line.decode("utf-8", "replace")], delimiter=source.separator)))
        if found > fields:
            return InputError(f"{source.file}, line {number}: there are {found} fields, but {fields} columns")
    return InputError(f"{source.file}: the rows cannot be read; a field or a quotation mark does not end")


def check_finite(frame: pl.DataFrame, source: RowSource, may_be_blank: frozenset[str] = frozenset()) -> None:
    """Check that every number is finite and no field is blank, but in the columns that ``may_be_blank``.

    Raises:
        InputError: with file, line and column of the first one that is not.
    """
    for name in frame.columns:
        values = frame[name]
        wrong = values.is_null() if name not in may_be_blank else pl.zeros(len(values), dtype=pl.Boolean, eager=True)
        if values.dtype == pl.Float64:
            wrong = wrong | values.is_not_null() & values.is_finite().not_().fill_null(False)
        if not wrong.any():
            continue
        row = int(wrong.arg_max() or 0)
        found = "the field is blank" if values[row] is None else f"{values[row]} is no finite number"
        raise InputError(f"{source.at(row)}, column '{source.header(name)}': {found}{_short_row(source, row)}")


def check_whole(values: pl.Series, source: RowSource, allowed: Sequence[int] = ()) -> None:
    """Check that a column holds whole numbers (of ``allowed``, where given), or blanks.

    Raises:
        InputError: with file, line and column of the first one that is not.
    """
    wrong = (values != values.round()).fill_null(False)
    if allowed:
        wrong = wrong | values.is_in([float(a) for a in allowed]).not_().fill_null(False)
    if wrong.any():
        row = int(wrong.arg_max() or 0)
        what = f"none of {', '.join(map(str, allowed))}" if allowed else "no whole number"
        raise InputError(f"{source.at(row)}, column '{source.header(values.name)}': {values[row]:g} is {what}")


def _short_row(source: RowSource, row: int) -> str:
    """Return a hint where the row has fewer fields than the columns before it."""
    if source.fields == 0:
        return ""
    fields = len(next(csv.reader([source.line_and_text(row)[1]], delimiter=source.separator)))
    return f" (the line has {fields} fields of {source.fields})" if fields < source.fields else ""
