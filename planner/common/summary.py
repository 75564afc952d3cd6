"""What a command says on the screen: one fact a line behind its key, most wanted first; more where that is asked."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

Fact = tuple[str, str]
"""A key of at most ``KEY`` signs, empty where the line goes on from the one before, and what is said of it."""

KEY = 12
"""Signs of the column of keys."""


SCREEN_LINES = 8
"""Lines of a screen, files and next step among them: what an eye takes in at once."""


class Aside(str):
    """A note that asks nothing of anybody: it is said with ``--verbose`` alone, and stands in files as any other."""

    __slots__ = ()


class Doubt(str):
    """A note that makes a verdict doubtful: a page shows it beside that, not folded away."""

    __slots__ = ()


def count_alike(notes: Iterable[str]) -> list[str]:
    """Return notes in their order, those that differ in numbers alone as the first of them with a count.

    Of notes that begin with the name of a file each file is named.
    """
    alike: dict[str, list[str]] = {}
    for note in notes:
        alike.setdefault(re.sub(r"[+-]?\d+(\.\d+)?", "#", note), []).append(note)
    return [
        own[0] if len(own) == 1 else f"{own[0]} (and {len(own) - 1} more like it{_files(own)})"
        for own in alike.values()
    ]


def _files(notes: Sequence[str]) -> str:
    """Return the files that all notes but the first begin with, where each has its own, as the end of a sentence."""
    files = [note.partition(": ")[0] for note in notes]
    if len(set(files)) < len(files) or not all(Path(f).suffix for f in files):
        return ""
    return f": {name_first([Path(f).name for f in files[1:]])}"


@dataclass(frozen=True)
class Summary:
    """What was found.

    Attributes:
        title: what it is and, where one number says it, how good.
        facts: one a line.
        details: facts for who wants to know more.
        notes: what a person must know; an :class:`Aside` is a detail.
        stays: one of the facts, for which the one before the cut gives way.
        in_full: those of the facts that the details say again, with more: beside these they are left out.
    """

    title: str
    facts: Sequence[Fact] = ()
    details: Sequence[Fact] = ()
    notes: Sequence[str] = ()
    stays: Fact | None = None
    in_full: Sequence[Fact] = ()

    def text(self, verbose: bool = False, most: int | None = None) -> str:
        """Return the title and the facts as lines; ``verbose``: the details and the asides too.

        ``most`` is a limit of lines, for a screen: the last facts give way (but what ``stays``), and notes where there
        are many; how many did is said. ``verbose`` knows no limit.
        """
        asked = [("note", note) for note in count_alike(n for n in self.notes if not isinstance(n, Aside))]
        if verbose:
            asides = [("aside", note) for note in count_alike(n for n in self.notes if isinstance(n, Aside))]
            facts = [fact for fact in self.facts if fact not in self.in_full]
            return "\n".join([self.title, *fact_lines([*facts, *asked, *self.details, *asides])])
        if most is not None:
            least = min(len(self.facts), 4, max(most - 2, 1))  # facts that stand beside any number of notes
            asked = cut_facts(asked, max(most - 1 - least, 1))
            facts = cut_facts(self.facts, max(most - 1 - len(asked), least), self.stays)
        else:
            facts = list(self.facts)
        return "\n".join([self.title, *fact_lines([*facts, *asked])])


def cut_facts(facts: Sequence[Fact], most: int, stays: Fact | None = None) -> list[Fact]:
    """Return the first facts, at most ``most``; the last of them says how many more there are.

    Where ``stays`` would be among those, it takes the last one's place.
    """
    if len(facts) <= most:
        return list(facts)
    key, said = facts[most - 1] if stays is None or stays in facts[:most] else stays
    count = len(facts) - most
    return [*facts[: most - 1], (key, f"{said} (and {count} more line{'s' if count > 1 else ''}: -v)")]


def name_first(names: Sequence[str]) -> str:
    """Return names in a line, of many the first and how many more there are."""
    most_named = 8  # things that are named in a line
    more = len(names) - most_named
    return ", ".join(names) if more <= 1 else f"{', '.join(names[:most_named])} and {more} more"


def under_key(key: str, texts: Iterable[str]) -> list[Fact]:
    """Return texts as facts of one key, which stands before the first of them."""
    return [(key if k == 0 else "", text) for k, text in enumerate(texts)]


def fact_lines(facts: Iterable[Fact]) -> list[str]:
    """Return facts as lines, what is said of them in one column."""
    return [f"  {key:<{KEY}}{'' if len(key) < KEY else '  '}{text}".rstrip() for key, text in facts]


def hang_lines(text: str, width: int) -> str:
    """Return a text whose long facts go on below themselves, not below their keys; commands stay whole."""
    return "\n".join(
        line if len(line) <= width or not line.startswith("  ") or "edbb " in line else _hanging_line(line, width)
        for line in text.split("\n")
    )


def _hanging_line(line: str, width: int) -> str:
    below = " " * (KEY + 2)
    return textwrap.fill(line, width, subsequent_indent=below, break_long_words=False, break_on_hyphens=False)
