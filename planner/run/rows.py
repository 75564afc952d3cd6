"""Separated text into a table of numbers and names; the first field that is none is named by line and column."""

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
import polars as pl

from planner.errors import InputError
from planner.run.source import Source, without_blank_lines

Schema = Mapping[str, pl.DataType | type[pl.DataType]]


def parse_rows(source: Source, headers: Sequence[str], numbers: frozenset[str], decimal: str = ".") -> pl.DataFrame:
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
            return _stripped(_read(body, source, schema))
    try:
        text = _read(body, source, {h: pl.String for h in headers})
    except pl.exceptions.ComputeError as err:
        raise _ragged(source, len(headers)) from err
    return numbers_in(text, source, numbers, decimal)


def _read(body: bytes, source: Source, schema: Schema) -> pl.DataFrame:
    return pl.read_csv(
        io.BytesIO(body),
        has_header=False,
        schema=schema,
        separator=source.separator,
        comment_prefix=source.comment or None,
    )


def _stripped(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the table with the spaces around texts taken off, and null where nothing is left."""
    text = pl.col(pl.String).str.strip_chars()
    return frame.with_columns(pl.when(text != "").then(text).name.keep())


def numbers_in(text: pl.DataFrame, source: Source, numbers: frozenset[str], decimal: str) -> pl.DataFrame:
    """Return a table of text with numbers in the columns ``numbers``, spaces around them forgiven.

    Raises:
        InputError: a field is no number.
    """
    text = _stripped(text)
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


def _ragged(source: Source, fields: int) -> InputError:
    for number, line in enumerate((source.body or b"").split(b"\n"), start=source.skipped + 1):
        if not source.is_row(line):
            continue
        found = len(next(csv.reader([line.decode("utf-8", "replace")], delimiter=source.separator)))
        if found > fields:
            return InputError(f"{source.file}, line {number}: there are {found} fields, but {fields} columns")
    return InputError(f"{source.file}: the rows cannot be read; a field or a quotation mark does not end")


def finite(frame: pl.DataFrame, source: Source, may_be_blank: frozenset[str] = frozenset()) -> None:
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


def whole(values: pl.Series, source: Source, allowed: Sequence[int] = ()) -> None:
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


def _short_row(source: Source, row: int) -> str:
    """Return a hint where the row has fewer fields than the columns before it."""
    if source.fields == 0:
        return ""
    fields = len(next(csv.reader([source.line_and_text(row)[1]], delimiter=source.separator)))
    return f" (the line has {fields} fields of {source.fields})" if fields < source.fields else ""
