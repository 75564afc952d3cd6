"""Where a row of a table came from, so that a message can name file, line and column."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.run.types import IntArray


@dataclass(frozen=True)
class Source:
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
