"""The column map (schema ``edbb-map/1``): which column of a trace is which quantity of a run."""

from __future__ import annotations

import codecs
import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from planner.common.schema import StrictModel, check_pattern
from planner.runs.clock_times import check_clock
from planner.runs.table import RunColumn, find_column, known_headers, spellings, split_key, units_of

ENCODINGS = re.compile(  # of text; not those that obey escapes (unicode_escape), nor of names of hosts (idna, punycode)
    r"ascii|utf-(8|16|32)(-\w+)?|iso8859-\d+|cp\d+|mac-\w+|koi8-\w|gb\w+|big5\w*|shift_jis\w*|euc_\w+|tis-620"
)


def _encoding(name: str) -> str:
    try:
        found = codecs.lookup(name).name.replace("utf-8-sig", "utf-8")
    except (LookupError, ValueError):
        found = ""
    if not ENCODINGS.fullmatch(found):
        raise ValueError("is no encoding of text; utf-8, latin-1, cp1252 or utf-16 are usual ones")
    return found


def _pattern(text: str) -> str:
    if not re.compile(check_pattern(text)).groupindex:
        raise ValueError("has no named group; (?P<q1_deg>…) says which part is which column")
    return text


def _one_character(text: str) -> str:
    if len(text) == 1 and text not in '"\r\n' and not text.isalnum():
        return text
    raise ValueError("is not one sign; ',', ';', '\\t' or ' ' are usual ones")


class MappedColumn(StrictModel):
    """A column taken with a change: value · ``factor`` + ``offset``, in the unit that the quantity is given in.

    A time may stand as a clock's or a calendar's: ``clock`` is its form (``%d.%m.%Y %H:%M:%S``; decimals of a second
    follow by themselves), ``date`` the column of the day where that is another one, whose text stands before the
    clock's. ``nanoseconds`` is a column of them, to be added to whole seconds.
    """

    column: int | str
    clock: Annotated[str, AfterValidator(check_clock)] | None = None
    date: int | str | None = None
    nanoseconds: int | str | None = None
    factor: Annotated[float, Field(ge=-1e12, le=1e12)] = 1.0
    offset: Annotated[float, Field(ge=-1e18, le=1e18)] = 0.0  # a clock may count nanoseconds since 1970

    @model_validator(mode="after")
    def _some_factor(self) -> MappedColumn:
        if self.factor == 0.0:
            raise ValueError("a factor of 0 leaves nothing of the column")
        if self.date is not None and self.clock is None:
            raise ValueError('a column of the date needs clock = "FORM", the form of date and clock')
        if self.clock is not None and self.nanoseconds is not None:
            raise ValueError("clock and nanoseconds are two ways to write a time: keep one of them")
        return self

    @property
    def parts(self) -> dict[str, int | str]:
        """Return the further columns that belong to it, by their keys."""
        found = {"date": self.date, "nanoseconds": self.nanoseconds}
        return {key: column for key, column in found.items() if column is not None}


class TraceMap(StrictModel):
    """How one trace is written.

    Either ``pattern`` (a regular expression with named groups, put to each line; lines without a match are passed over)
    or ``columns``: quantity = position (from 1), or the text that stands above the column, or a table with ``column``,
    ``factor`` and ``offset``. A quantity is named with its unit (``q1_deg``), or alone, with its unit in ``units``.
    ``constants`` hold what is the same in every row.
    """

    encoding: Annotated[str, AfterValidator(_encoding)] = "utf-8"
    decimal: Literal[".", ","] = "."
    separator: Annotated[str, AfterValidator(_one_character)] = ","
    header: bool = True
    skip_rows: int = Field(default=0, ge=0)
    unit_rows: int = Field(default=0, ge=0, le=5)  # rows of units between the titles and the numbers
    comment: str = "#"
    pattern: Annotated[str, AfterValidator(_pattern)] | None = None
    columns: dict[str, int | str | MappedColumn] = {}
    units: dict[str, str] = {}
    constants: dict[str, int | float | str] = {}

    @model_validator(mode="after")
    def _check_consistent(self) -> TraceMap:
        if (self.pattern is None) == (not self.columns):
            raise ValueError("either [columns] or a pattern is needed, and not both")
        if self.pattern is None and self.separator == self.decimal:
            raise ValueError(f"separator and decimal are both '{self.decimal}'")
        for key, unit in self.units.items():
            if key not in {_key_of(name) for name in self.names}:
                raise ValueError(f"[units] names '{key}', which is no column of this map")
            column_in_unit(key, unit)
        keys = [self.column_of(name).key for name in (*self.names, *self.constants)]
        for key in keys:
            if keys.count(key) > 1:
                raise ValueError(f"'{key}' is mapped twice")
        for name in self.columns:
            picked = self.column(name)
            if (picked.clock or picked.parts) and self.column_of(name).key != "t":
                raise ValueError(f"{name}: clock, date and nanoseconds belong to the time t_s alone")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the mapped columns."""
        return tuple(self.columns) if self.pattern is None else tuple(re.compile(self.pattern).groupindex)

    def column_of(self, name: str) -> RunColumn:
        """Return the column that a name of this map stands for.

        Raises:
            ValueError: there is no such quantity, or its unit is missing or wrong.
        """
        if name in self.units:
            return column_in_unit(name, self.units[name])
        found = find_column(name)
        if found is None:
            key = _key_of(name)
            if units_of(key) is None:
                raise ValueError(f"'{name}' is no quantity of a run ({', '.join(known_headers(1))}, …)")
            raise ValueError(
                f"'{name}' does not say its unit: call it {spellings(key)}, or give {key} a unit in [units]"
            )
        return found

    def column(self, name: str) -> MappedColumn:
        """Return where a column is and what its values are changed by."""
        what = self.columns[name]
        return what if isinstance(what, MappedColumn) else MappedColumn(column=what)


class ColumnMap(TraceMap):
    """A whole map: the first trace at the top level, further ones (another file each) under ``[[traces]]``.

    ``angles`` (``degrees``) says that an arm moves so little that its degrees look like radians. ``axes_of`` names
    the language of the controller whose axes the angles are (``model``: the joints of the robot's model), ``robot`` the
    shipped robot, or its file beside the map, that says how that controller counts. ``join = "rows"`` joins two traces
    row by row.
    """

    schema_: Literal["edbb-map/1"] = Field(alias="schema")
    measure: Literal["static", "continuous"] | None = None
    robot: str | None = None
    axes_of: str | None = None
    plan_id: str | None = None
    angles: Literal["degrees"] | None = None
    join: Literal["rows"] | None = None
    traces: tuple[TraceMap, ...] = ()

    @property
    def all_traces(self) -> tuple[TraceMap, ...]:
        """Return the maps in the order of the traces."""
        return (self, *self.traces)

    @property
    def n_joints(self) -> int:
        """Return the largest number of a joint that is mapped, 0 where none is."""
        names = (m.column_of(name).key for m in self.all_traces for name in m.names)
        return max((split_key(key)[1] for key in names), default=0)


def column_in_unit(key: str, unit: str) -> RunColumn:
    """Return the column of a quantity in a unit.

    Raises:
        ValueError: there is no such quantity, or it is not written in that unit.
    """
    extra_units = {"t": {"ms": 1e-3, "us": 1e-6, "min": 60.0}, "force": {"kN": 1e3}}  # beside those of a run's columns
    units = {**(units_of(key) or {}), **extra_units.get(key, {})}
    if unit not in units:
        allowed = ", ".join(units)
        raise ValueError(
            f"{key} = '{unit}' is no unit of it" + (f" (allowed: {allowed})" if allowed else "; it has none")
        )
    return RunColumn(f"{key}_{unit}", key, unit, units[unit])


def _key_of(name: str) -> str:
    return name.partition("_")[0]
