"""How a table of somebody else is written: what stands between its columns, in its numbers, above its columns."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

NUMBER = re.compile(r"[-+]?\d+([.,]\d+)?")
SEPARATORS = (";", "\t", ",")


@dataclass(frozen=True)
class ForeignTable:
    """How a table of somebody else is written, as far as its first lines tell.

    Attributes:
        separator: between two columns.
        decimal: sign, ``.`` or ``,``.
        skip: lines above the titles.
        titles: what stands above the columns.
        rows: the fields of the first rows.
    """

    separator: str
    decimal: str
    skip: int
    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def numbers(self, column: int) -> list[float]:
        """Return the numbers of a column; empty where one field is none."""
        try:
            return [float(row[column].strip().replace(self.decimal, ".")) for row in self.rows]
        except ValueError:
            return []


def foreign_table(lines: Sequence[str]) -> ForeignTable | None:
    """Return separator, titles and decimals of a table; ``None`` if the lines are not columns under titles."""
    # 60 lines tell how the others are written
    found = (t for s in SEPARATORS if (t := _table_between(lines[:60], s)) is not None)
    return next(found, None)


def _table_between(lines: Sequence[str], separator: str) -> ForeignTable | None:
    """Return the lines as columns between ``separator``, ``None`` where they are no such table."""
    numbered = [(k, line) for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    rows = [next(csv.reader([line], delimiter=separator), []) for _, line in numbered]
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    top = next((k for k, row in enumerate(rows) if len(row) == width), 0)
    below = tuple(tuple(row) for row in rows[top + 1 :] if len(row) == width)
    if width < 2 or not below:
        return None
    fields = [field.strip() for row in below for field in row]
    commas = sum(bool(re.fullmatch(r"[-+]?\d+,\d+", field)) for field in fields)
    points = sum(bool(re.fullmatch(r"[-+]?\d+\.\d+", field)) for field in fields)
    titles = tuple(title.strip() for title in rows[top])
    if any(NUMBER.fullmatch(title) for title in titles):  # commas of decimals took the rows apart
        return None
    return ForeignTable(separator, "," if commas > points else ".", numbered[top][0], titles, below)
