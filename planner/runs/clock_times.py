"""Times as clocks and calendars write them, turned into seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from planner.common.lazy_modules import pl
from planner.runs.text import RowSource, first_row

FORMS = (  # of dates and clocks, as they are tried; the decimals of a second follow by themselves
    "%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M:%S", "%Y/%m/%d %H:%M:%S", "%Y/%m/%d-%H:%M:%S", "%Y%m%dT%H%M%S",
    "%d.%m.%Y %H:%M:%S", "%d.%m.%y %H:%M:%S", "%d-%b-%Y %H:%M:%S", "%H:%M:%S", "%Y-%m-%d %H:%M", "%d.%m.%Y %H:%M",
    "%H:%M", "%I:%M:%S %p",
)  # fmt: skip
TWO_WAYS = tuple(  # day and month in either order, of which only one may fit
    f"{day} {clock}" for clock in ("%H:%M:%S", "%I:%M:%S %p") for day in ("%d/%m/%Y", "%m/%d/%Y")
)
DATES = ("%Y-%m-%d", "%d.%m.%Y", "%Y/%m/%d", "%d.%m.%y")
_ZONE = re.compile(r"\s*(Z|UTC|[+-]\d\d:?\d\d)$")
_DIRECTIVES = re.compile(r"%(.)")


def check_clock(form: str) -> str:
    """Return the form of a clock, if it is one: ``%H`` and ``%M``, with ``%Y %m %d`` and ``%S`` where these stand.

    A clock of twelve hours has ``%I`` and ``%p`` (AM, PM) for ``%H``.

    Raises:
        ValueError: another directive, or no hours and minutes.
    """
    found = _DIRECTIVES.findall(form)
    strange = [d for d in found if d not in "YymdbHMSIp"]
    if strange or not ({"H", "M"} <= set(found) or {"I", "M", "p"} <= set(found)):
        why = f"%{strange[0]} is not read" if strange else "hours %H (or %I with %p) and minutes %M are needed"
        raise ValueError(f"is no form of a clock: {why}; such as %d.%m.%Y %H:%M:%S")
    return form


def clock_form(texts: Sequence[str]) -> str | None:
    """Return the form in which all of some texts are times; ``None`` where there is none, or day and month are open."""
    if not texts or not all(re.search(r"\d:?\d\d", text) for text in texts):
        return None
    series = pl.Series(list(texts))
    for form in FORMS:
        if _parse(series, form).null_count() == 0:
            return form
    fitting = [form for form in TWO_WAYS if _parse(series, form).null_count() == 0]
    return fitting[0] if len(fitting) == 1 else None


def date_form(texts: Sequence[str]) -> str | None:
    """Return the form in which all of some texts are dates, else ``None``."""
    if not texts:
        return None
    series = pl.Series([f"{text.strip()} 00:00:00" for text in texts])
    return next((form for form in DATES if _parse(series, f"{form} %H:%M:%S").null_count() == 0), None)


def seconds_of(texts: pl.Series, form: str, source: RowSource, name: str) -> pl.Series:
    """Return times (n,) [s] of a clock's texts: since 1970 where a date stands there, else since midnight, going on.

    Raises:
        InputError: with the line of the first text that has another form, or another time zone than the first.
    """
    zones = [m[1] if (m := _ZONE.search(text or "")) else "" for text in texts]
    if (row := first_row(np.array([zone != zones[0] for zone in zones]))) is not None:
        raise source.error(row, name, f"{texts[row]!r} is of another time zone than the rows before")
    found = _parse(texts, form)
    if (row := first_row(found.is_null())) is not None:
        raise source.error(row, name, f"{texts[row]!r} is no time of the form '{form}'")
    seconds = found.dt.epoch("us").to_numpy().astype(np.int64) * 1e-6
    if "%d" not in form:  # a clock without a date goes on after midnight
        day = 86400.0  # [s]
        seconds = seconds + day * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -day / 2)
    return pl.Series(texts.name, seconds)


def _parse(texts: pl.Series, form: str) -> pl.Series:
    """Return datetimes (n,), null where a text has another form; without a date they are of the first day of 1970."""
    plain = texts.str.strip_chars().str.replace(_ZONE.pattern, "").str.replace(",", ".", literal=True)
    day, clock = ("", "") if "%d" in form else ("1970-01-01 ", "%Y-%m-%d ")
    plain = (pl.Series([day] * len(plain), dtype=pl.String) + plain) if day else plain
    decimals = "%.f" if form.endswith("%S") else ""
    return plain.str.to_datetime(f"{clock}{form}{decimals}", strict=False, time_unit="us", exact=True)
