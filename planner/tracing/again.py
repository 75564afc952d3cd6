"""Effects that come more than once at a place: a gear errs with several periods, an arm warms up in several ways.

Each is a finding of its own, with an inner number of its own.
"""

from dataclasses import replace
from functools import partial

from planner.catalogue import Entry
from planner.model import Parameter
from planner.tracing.state import Held

KINDS = ("gear ripple", "warm-up")
MOST = 4  # of one kind at one place
APART = 3  # spacings of the grid between the frequencies of two of them
MARK = " ("


def numbered(entry: Entry, effects: tuple[Held, ...]) -> Entry:
    """Return the entry under a name that no effect has yet."""
    others = {h.entry.name for h in effects}
    count, again = 1, entry
    while again.name in others:
        count += 1
        again = replace(entry, kind=f"{entry.kind}{MARK}{count})", make=partial(_again, entry, count))
    return again


def _again(entry: Entry, count: int, inner: float | None) -> tuple[Parameter, ...]:
    return tuple(replace(p, name=f"{p.name}_{count}") for p in entry.make(inner))


def plain(kind: str) -> str:
    """The kind without the number of its turn."""
    return kind.split(MARK)[0]


def taken(entry: Entry, effects: tuple[Held, ...]) -> list[float]:
    """Inner numbers that effects of this entry have already."""
    return [h.inner for h in effects if plain(h.entry.kind) == entry.kind and h.entry.on == entry.on and h.inner]


def open_to(entry: Entry, effects: tuple[Held, ...]) -> bool:
    """Whether the entry may be added to these effects."""
    if entry.name not in {h.entry.name for h in effects}:
        return True
    return entry.kind in KINDS and len(taken(entry, effects)) < MOST
