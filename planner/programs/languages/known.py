"""The list of statements that a released program may hold beside its moves; whatever is not on it is unknown."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache

from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.statements import Statement

ANY = "987654321"  # stands for any number in a line of the dialect while it is parsed
NUMBERS = ("tool", "base", "load")


def known_statements(
    dialect: Dialect, parse: Callable[[Sequence[str]], Iterable[Statement]], program: Program | None
) -> Callable[[Statement], bool]:
    """Return what tells whether a statement is known: one of the dialect's own lines, or of its ``passive`` patterns.

    Args:
        dialect: whose file lists the lines and patterns.
        parse: of the dialect's reader, so that a line looks as it does in a program.
        program: only its own tool, base, load and signals are known; without one any number is.
    """
    lines = (s.text for text in _own_lines(dialect, program) for s in parse((text,)))
    texts = [re.escape(_squeeze(line)) for line in lines]
    circles = dialect.circle.passive if dialect.circle and (program is None or program.circles) else ()
    texts += [
        p for text in (*dialect.reading.passive, *circles) if (p := _with_numbers(text, dialect, program)) is not None
    ]
    patterns = [re.compile(text.replace(ANY, r"\d+"), re.IGNORECASE) for text in dict.fromkeys(texts)]

    @cache
    def is_known(said: str) -> bool:
        return any(p.fullmatch(said) for p in patterns)

    return lambda statement: is_known(_squeeze(statement.text))


def _own_lines(dialect: Dialect, program: Program | None) -> Iterator[str]:
    """Yield the blocks of lines that the dialect's file lists, with the program's numbers in them."""
    sync, select = dialect.sync, dialect.select
    for lines in (dialect.header, dialect.footer, dialect.pause, dialect.wait, sync.header, sync.rest, sync.flying_on,
                  sync.flying_off):  # fmt: skip
        yield (_with_numbers("\n".join(lines), dialect, program) or "").replace("{number}", ANY)
    for name in NUMBERS:
        yield _with_numbers(getattr(select, name).replace("{number}", f"{{{name}}}"), dialect, program) or ""


def _with_numbers(text: str, dialect: Dialect, program: Program | None) -> str | None:
    """Return ``text`` with numbers and signals in it; nothing where it wants one that the program has not."""

    def number(key: str) -> int | None:
        found = int(ANY) if program is None else getattr(program, key)
        return None if found is None else int(found)

    for name in NUMBERS:
        if f"{{{name}}}" in text and (chosen := number(name)) is not None:
            text = text.replace(f"{{{name}}}", str(chosen))
    text = dialect.signal(text, number("sync_output"), number("gauge_input"))
    return None if re.search(r"\{(tool|base|load|output|input)\}", text) else text


def _squeeze(text: str) -> str:
    return " ".join(text.split())
