"""The column map: how a controller's or a gauge's trace is written, and which of its columns are which quantities."""

import codecs
import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from planner.common.schema import StrictModel, check_pattern
from planner.runs.columns import RunColumn, find_column, known_headers, spellings, split_key, units_of

EXTRA_UNITS = {"t": {"ms": 1e-3, "us": 1e-6, "min": 60.0}, "force": {"kN": 1e3}}  # beside those of a run's columns


def _encoding(name: str) -> str:
    try:
        "a".encode(name)  # refuses what makes anything but text, such as zlib
        return codecs.lookup(name).name
    except (LookupError, ValueError) as err:
        raise ValueError("is no encoding of text; utf-8, latin-1, cp1252 or utf-16 are usual ones") from err


def _pattern(text: str) -> str:
    if not re.compile(check_pattern(text)).groupindex:
        raise ValueError("has no named group; (?P<q1_deg>…) says which part is which column")
    return text


def _one_character(text: str) -> str:
    if len(text) == 1 and text not in '"\r\n' and not text.isalnum():
        return text
    raise ValueError("is not one sign; ',', ';', '\\t' or ' ' are usual ones")


class MappedColumn(StrictModel):
    """A column taken with a change: value · ``factor`` + ``offset``, in the unit that the quantity is given in."""

    column: int | str
    factor: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _some_factor(self) -> "MappedColumn":
        if self.factor == 0.0:
            raise ValueError("a factor of 0 leaves nothing of the column")
        return self


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
    comment: str = "#"
    pattern: Annotated[str, AfterValidator(_pattern)] | None = None
    columns: dict[str, int | str | MappedColumn] = {}
    units: dict[str, str] = {}
    constants: dict[str, int | float | str] = {}

    @model_validator(mode="after")
    def _consistent(self) -> "TraceMap":
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
    """A whole map: the first trace at the top level, further ones (another file each) under ``[[traces]]``."""

    schema_: Literal["edbb-map/1"] = Field(alias="schema")
    measure: Literal["static", "continuous"] | None = None
    robot: str | None = None
    plan_id: str | None = None
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
    units = {**(units_of(key) or {}), **EXTRA_UNITS.get(key, {})}
    if unit not in units:
        allowed = ", ".join(units)
        raise ValueError(
            f"{key} = '{unit}' is no unit of it" + (f" (allowed: {allowed})" if allowed else "; it has none")
        )
    return RunColumn(f"{key}_{unit}", key, unit, units[unit])


def _key_of(name: str) -> str:
    return name.partition("_")[0]
