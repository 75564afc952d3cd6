"""One root for every error that a person can cause or cure, with the exit code of its class."""

import re
import unicodedata
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

FAILED = 3
"""Exit code of a command that has judged something, and it did not pass; the result is written and said."""

PARTLY_DONE = 5
"""Exit code of a command that has written its result, and has left parts of the input as they were."""


MOST_SIGNS, MOST_RUN = 2500, 300  # of a message, and of its text without a space
_HIDDEN = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}  # signs that steer a terminal, turn the writing round or break lines
_RUN = re.compile(rf"\S{{{MOST_RUN + 1},}}")


def make_printable(text: str, most: int = MOST_SIGNS) -> str:
    """Return text of a file for a terminal: control signs spelt out, tabs as blanks, long runs cut in their middle."""
    text = text.replace("\t", " ")
    kept = "".join(c if c == "\n" or unicodedata.category(c) not in _HIDDEN else repr(c)[1:-1] for c in text)
    kept = _RUN.sub(lambda m: f"{m[0][: MOST_RUN // 2]}…{m[0][-MOST_RUN // 3 :]}", kept)
    return kept if len(kept) <= most else _fewer_lines(kept.split("\n"), most)


def is_printable_line(text: str) -> bool:
    """Tell whether text stands on one line of a terminal as it is."""
    return "\n" not in text and make_printable(text) == text


def _fewer_lines(lines: list[str], most: int) -> str:
    """Cut long lines in their middle, then leave out whole lines before the last, and say how many."""
    part = most // (2 if len(lines) > 1 else 1) - 20
    lines = [line if len(line) <= part else f"{line[: part - 260]} … {line[-250:]}" for line in lines]
    shown, size = 0, len(lines[-1]) + 40
    while shown < len(lines) - 1 and size + len(lines[shown]) + 1 <= most:
        size += len(lines[shown]) + 1
        shown += 1
    out = len(lines) - 1 - shown
    return "\n".join([*lines[:shown], *([f"… {out} lines left out …"] if out else []), lines[-1]])


class PlannerError(Exception):
    """Root of all errors raised on purpose; the message is one clear sentence for the person at the cell."""

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        super().__init__(make_printable(message))


class InputError(PlannerError):
    """The user's input is wrong: the message names file, key or line, what was found, what is allowed."""

    exit_code = 2


class DeclarationError(PlannerError):
    """A command or an option is declared wrongly: the message names class and field, and what is to be written."""


class LookFirst(InputError):
    """A first call has written what a person looks at before the same call does its work; the message says both.

    It has the exit code of an error, so that nothing goes on that waits for the result.
    """


class NoSolutionError(PlannerError):
    """The task has no solution: the message says which stage emptied, with counts, and what would help."""

    exit_code = 3


class MissingProgramError(PlannerError):
    """A program that was asked for by name is not on this machine."""

    exit_code = 4


def did_you_mean(word: str, known: list[str]) -> str:
    """Return ``'; did you mean "x"?'`` for the nearest of ``known``, or an empty string.

    Parts count: ``kr6`` and ``kr6/edbb`` find ``kuka-kr6-r700/edbb``, and ``kr10`` finds the other arm of the series.
    Where none is near as a whole, it is the one with most words in common: for ``wobble`` it is an axis wobble.
    """
    near, any_near = (get_close_matches(word, known, n=1, cutoff=cutoff) for cutoff in (0.75, 0.5))
    parts = _with_parts(word.lower(), known) or _of_series(word.lower(), known)
    match = [k for k in near if not parts or k in parts] or parts[:3] or near
    match = match or _nearest_in_words(word, known) or any_near
    return f"; did you mean {' or '.join(chr(34) + k + chr(34) for k in match)}?" if match else ""


def _with_parts(word: str, known: list[str]) -> list[str]:
    """Return the paths ``robot/cell`` whose parts hold those of ``word``: ``kr6/edbb`` is in ``kuka-kr6-r700/edbb``."""
    asked = word.split("/")
    if len(word) < 3 or not re.search(r"\d", asked[0]):
        return []
    pairs = ((k, k.lower().split("/")) for k in known)
    return [k for k, own in pairs if len(own) >= len(asked) and all(map(_holds_part, own, asked))]


def _holds_part(own: str, part: str) -> bool:
    return any(word.startswith(part) for word in own.split("-")) or own.startswith(part)


def _of_series(word: str, known: list[str]) -> list[str]:
    """Return the names with a part of the same letters and another number: ``kr10`` is of the series of ``kr6``."""
    series = re.match(r"([a-z]+)\d", word)
    if series is None:
        return []
    cell = word.partition("/")[2]
    alike = [k for k in known if re.search(rf"(^|-){series[1]}\d", k.lower().partition("/")[0])]
    return [k for k in alike if k.lower().partition("/")[2].startswith(cell)] or alike


def _nearest_in_words(word: str, known: list[str]) -> list[str]:
    """Return the first of those of which most words are near one of ``word``'s; short words say nothing."""
    asked = [w for w in re.findall(r"\w+", word.lower()) if len(w) > 2]
    shared = [sum(bool(get_close_matches(w, k.lower().split(), n=1, cutoff=0.75)) for w in asked) for k in known]
    return [known[shared.index(max(shared))]] if any(shared) else []


def read_together(*readers: Callable[[], Any]) -> list[Any]:
    """Return the results of all readers; every one is called, so that a single message names all errors.

    Raises:
        InputError: the messages of those that raised one, a line each.
    """
    found, messages = list[Any](), list[str]()
    for read in readers:
        try:
            found.append(read())
        except InputError as error:
            messages.append(str(error))
    if messages:
        raise InputError("\n".join(dict.fromkeys(messages)))
    return found
