"""A quantity of the record, the table that keeps them, and how far one has moved."""

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

DIGITS = 5
ROUNDING = 1.0001  # a value that moved by exactly its tolerance has not left it


@dataclass(frozen=True, order=True)
class Quantity:
    """One row of the table.

    Attributes:
        case, name: by which it is known.
        value: in ``unit``.
        tolerance: within which it may move, in its unit, or in percent of its kept value: ``0.05`` or ``5 %``.
        better: which direction is an improvement: ``less``, ``more``, or nothing where neither is.
    """

    case: str
    name: str
    value: float
    unit: str
    tolerance: str
    better: str = ""

    @property
    def allowed(self) -> float:
        """The tolerance in the quantity's unit."""
        number, percent, _ = self.tolerance.partition(" %")
        return float(number) * (abs(self.value) / 100 if percent else 1.0)


@dataclass(frozen=True)
class Change:
    """A quantity as it was and as it is; ``None`` where the table, or the run, has no such quantity."""

    kept: Quantity | None
    found: Quantity | None

    @property
    def key(self) -> tuple[str, str]:
        """Case and name."""
        some = self.kept or self.found
        assert some
        return some.case, some.name

    @property
    def outside(self) -> bool:
        """Whether it moved beyond its tolerance, is new or no longer there."""
        if not (self.kept and self.found):
            return True
        allowed = max(self.kept.allowed * ROUNDING, abs(self.kept.value) * 10.0 ** (1 - DIGITS))
        return self.kept.unit != self.found.unit or not abs(self.found.value - self.kept.value) <= allowed

    @property
    def verdict(self) -> str:
        """``better``, ``worse``, ``moved``, ``new``, ``missing`` or ``within``."""
        if not self.outside:
            return "within"
        if not (self.kept and self.found):
            return "new" if self.found else "missing"
        if self.kept.unit != self.found.unit or math.isnan(self.found.value):
            return "moved"
        grew = self.found.value > self.kept.value
        return {"": "moved", "more": "better" if grew else "worse", "less": "worse" if grew else "better"}[
            self.kept.better
        ]

    @property
    def text(self) -> str:
        """By how much it moved, in which direction and against which tolerance."""
        case, name = self.key
        if not (self.kept and self.found):
            some = self.kept or self.found
            assert some
            return f"{self.verdict:7} {case}, {name}: {number(some.value)} {some.unit}"
        step = self.found.value - self.kept.value
        share = f" ({100 * step / abs(self.kept.value):+.2g} %)" if self.kept.value and math.isfinite(step) else ""
        return (
            f"{self.verdict:7} {case}, {name}: {number(self.kept.value)} -> {number(self.found.value)} "
            f"{self.found.unit}, {step:+.3g}{share}, tolerance {self.kept.tolerance}"
        )


def number(value: float) -> str:
    """Return a value as the table has it."""
    return f"{value:.{DIGITS}g}"


def changes(kept: Iterable[Quantity], found: Iterable[Quantity]) -> list[Change]:
    """Return every quantity of either, by case and name."""
    old, new = ({(q.case, q.name): q for q in many} for many in (kept, found))
    return [Change(old.get(key), new.get(key)) for key in sorted({*old, *new})]


def renewed(kept: Iterable[Quantity], found: Iterable[Quantity]) -> list[Quantity]:
    """Return the table with what moved beyond its tolerance written anew.

    What moved within keeps its value, so that small steps add up until they are seen, and the tolerance that the
    table has for it.
    """
    out = []
    for c in changes(kept, found):
        if c.found:
            tolerance = c.kept.tolerance if c.kept else c.found.tolerance
            value = c.found.value if c.outside or not c.kept else c.kept.value
            out.append(Quantity(*c.key, value, c.found.unit, tolerance, c.found.better))
    return out


def read_table(path: Path) -> list[Quantity]:
    """Return the rows of a table; none where there is no file."""
    if not path.exists():
        return []
    rows = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
    return [Quantity(r["case"], r["name"], float(r["value"]), r["unit"], r["tolerance"], r["better"]) for r in rows]


def write_table(path: Path, table: Iterable[Quantity]) -> None:
    """Write the rows, sorted, so that a difference of two tables is read line by line."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow([f.name for f in fields(Quantity)])
    for q in sorted(table):
        out.writerow([number(v) if isinstance(v, float) else v for v in astuple(q)])
    path.write_text(text.getvalue(), encoding="utf-8")
