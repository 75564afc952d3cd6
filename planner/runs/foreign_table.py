"""How a table of somebody else is written: what stands between its columns, in its numbers, above its columns."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from planner.runs.title_units import UNIT, bare_unit, is_row_of_units

NUMBER = re.compile(r"[-+]?\d+([.,]\d+)?([eE][-+]?\d+)?")
SEPARATORS = (";", "\t", ",", " ")


@dataclass(frozen=True)
class ForeignTable:
    """How a table of somebody else is written, as far as its first lines tell.

    Attributes:
        separator: between two columns.
        decimal: sign, ``.`` or ``,``.
        skip: lines above the titles.
        titles: what stands above the columns.
        rows: the fields of the first rows.
        units: the row of units below the titles, or nothing.
        header: whether titles stand above the columns; else ``titles`` are their numbers from 1.
    """

    separator: str
    decimal: str
    skip: int
    titles: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    units: tuple[str, ...] = ()
    header: bool = True

    @property
    def has_units(self) -> bool:
        """Whether a row of units stands below the titles."""
        return bool(self.units)

    def title_with_unit(self, column: int) -> str:
        """Return the title of a column with the unit that stands below it, where it says none itself."""
        title, unit = self.titles[column], bare_unit(self.units[column]) if self.units else ""
        return f"{title} [{unit}]" if unit.strip("-–/") and not UNIT.search(title) else title

    def texts(self, column: int) -> list[str]:
        """Return the fields of a column as they are written."""
        return [row[column].strip() for row in self.rows]

    def numbers(self, column: int) -> list[float]:
        """Return the numbers of a column; empty where one field is none."""
        try:
            return [float(row[column].strip().replace(self.decimal, ".")) for row in self.rows]
        except ValueError:
            return []


def foreign_table(lines: Sequence[str]) -> ForeignTable | None:
    """Return separator, titles and decimals of a table; ``None`` if the lines are no columns."""
    # 60 lines tell how the others are written
    found = (t for s in SEPARATORS if (t := _table_between(lines[:60], s)) is not None)
    return next(found, None)


def _table_between(lines: Sequence[str], separator: str) -> ForeignTable | None:
    """Return the lines as columns between ``separator``, ``None`` where they are no such table."""
    numbered = [(k, line) for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    blank = separator == " "  # any number of blanks sets two fields apart
    rows = [line.split() if blank else next(csv.reader([line], delimiter=separator), []) for _, line in numbered]
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    top, units = _head(rows, width)
    below = tuple(tuple(row) for row in rows[top + 1 + bool(units) :] if len(row) == width)
    if width < 2 or not below:
        return None
    fields = [field.strip() for row in below for field in row]
    commas = sum(bool(re.fullmatch(r"[-+]?\d+,\d+", field)) for field in fields)
    points = sum(bool(re.fullmatch(r"[-+]?\d+\.\d+", field)) for field in fields)
    titles = tuple(title.strip() for title in rows[top])
    if any(NUMBER.fullmatch(title) for title in titles):
        below = tuple(tuple(row) for row in rows[top:])
        if any(len(row) != width or not all(map(is_value, row)) for row in below):
            return None  # commas of decimals took the rows apart
        numbers = tuple(str(k + 1) for k in range(width))
        return ForeignTable(separator, "," if commas > points else ".", numbered[top][0], numbers, below, header=False)
    return ForeignTable(separator, "," if commas > points else ".", numbered[top][0], titles, below, units)


def is_value(text: str) -> bool:
    """Tell whether a field is a number, or a time as clocks write it."""
    return bool(NUMBER.fullmatch(text.strip()) or re.fullmatch(r"[\d.:/TZ,+-]+", text.strip()))


def _head(rows: Sequence[Sequence[str]], width: int) -> tuple[int, tuple[str, ...]]:
    """Return which row holds the titles, and the row of units below it, or nothing.

    Above the first row of numbers the titles are the fullest row: what a spreadsheet has above them (a protocol's
    name, a date) fills a cell or two.
    """
    of_width = [k for k, row in enumerate(rows) if len(row) == width]
    first = of_width[0] if of_width else 0
    above = [k for k in of_width if k < next((n for n in of_width if _is_of_numbers(rows[n])), 0)]
    units = above.pop() if len(above) > 1 and is_row_of_units(rows[above[-1]]) else None
    if not above:
        return first, ()
    top = max(above, key=lambda k: (sum(bool(cell.strip()) for cell in rows[k]), -k))
    return top, tuple(rows[units]) if units == top + 1 else ()


def _is_of_numbers(row: Sequence[str]) -> bool:
    """Tell whether at least half of the cells of a row that say something are numbers."""
    said = [cell.strip() for cell in row if cell.strip()]
    return 2 * sum(NUMBER.fullmatch(cell) is not None for cell in said) >= max(len(said), 1)
