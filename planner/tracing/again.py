"""Waves that come more than once at a joint: a gear errs with several periods, each a finding of its own."""

from dataclasses import replace

from planner.catalogue import Entry
from planner.tracing.state import Held

KIND = "gear ripple"
MOST = 4  # waves of one joint
APART = 3  # spacings of the grid between the frequencies of two of them
MARK = " ("


def numbered(entry: Entry, effects: tuple[Held, ...]) -> Entry:
    """Return the entry under a name that no effect has yet."""
    others = {h.entry.name for h in effects}
    count = 1
    again = entry
    while again.name in others:
        count += 1
        again = replace(entry, kind=f"{entry.kind}{MARK}{count})")
    return again


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
    return entry.kind == KIND and len(taken(entry, effects)) < MOST
