"""Where a row of a table came from, so that a message can name file, line and column."""

import re
from dataclasses import dataclass, field

from planner.run.types import IntArray


@dataclass(frozen=True)
class Source:
    """A file and how its rows lie in it.

    Attributes:
        file: its path as the person gave it.
        body: the text from the first row on, as read; ``None`` where the file has no lines (Parquet).
        skipped: lines before ``body``.
        comment: how a comment line begins.
        lines: number of the line of each row, where it is not just counted.
        headers: names of the columns as they stand in the file, by quantity.
    """

    file: str
    body: bytes | None = None
    skipped: int = 0
    comment: str = "#"
    lines: IntArray | None = None
    headers: tuple[tuple[str, str], ...] = field(default=())

    def at(self, row: int) -> str:
        """Return ``"run.csv, line 12"`` for row 0, 1, …"""
        if self.lines is not None:
            return f"{self.file}, line {self.lines[row]}"
        if self.body is None:
            return f"{self.file}, row {row + 1}"
        return f"{self.file}, line {self.line_and_text(row)[0]}"

    def line_and_text(self, row: int) -> tuple[int, str]:
        """Return the number of a row's line and its text."""
        seen = -1
        for number, line in enumerate((self.body or b"").split(b"\n"), start=self.skipped + 1):
            seen += not (is_blank(line) or line.startswith(self.comment.encode()))
            if seen == row:
                return number, line.decode("utf-8", "replace").rstrip("\r")
        raise IndexError(row)

    def header(self, key: str) -> str:
        """Return what the file calls a quantity."""
        return dict(self.headers).get(key, key)


def is_blank(line: bytes) -> bool:
    """Return whether a line holds nothing."""
    return not line.strip()


def without_blank_lines(body: bytes) -> bytes:
    """Return the text without its empty lines; the same object where there are none."""
    if re.search(rb"(?:\A|\n)[ \t]*\r?\n", body) is None:
        return body
    return b"\n".join(line for line in body.split(b"\n") if not is_blank(line))
