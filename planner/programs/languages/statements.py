"""Statements and numbers in a text with their places: what the reader of every language yields, and writes back."""

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from planner.common.errors import InputError

NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"  # in the digits that controllers read, not those of every script
EXPONENT_NUMBER = NUMBER + r"(?:[eE][-+]?[0-9]+)?"


@dataclass(frozen=True, slots=True)
class Slot:
    """A place for one number.

    Attributes:
        start, end: of the number in the text; equal where a word is to be inserted.
        unit: size of one printed unit in SI (m, rad, or 1).
        decimals: fewest digits behind the point when the number changes; 0 for whole numbers.
        prefix: what stands before an inserted number.
        aligned: whether spaces before the number may give way, to keep columns straight.
        decimal: sign between a number's whole part and its decimals.
    """

    start: int
    end: int
    unit: float
    decimals: int
    prefix: str = ""
    aligned: bool = True
    decimal: str = "."


@dataclass(frozen=True)
class Lines:
    """The lines of a text, with their places; only line feeds and carriage returns end a line."""

    text: str
    starts: tuple[int, ...]

    @classmethod
    def of(cls, text: str) -> "Lines":
        """Cut ``text`` into lines."""
        ends = [m.end() for m in re.finditer(r"\r\n|\n|\r", text)]
        return cls(text, (0, *(e for e in ends if e < len(text))))

    def __iter__(self) -> Iterator[tuple[int, int, str]]:
        """Yield number (from 1), place and text of every line, without its end."""
        for k, start in enumerate(self.starts):
            end = self.starts[k + 1] if k + 1 < len(self.starts) else len(self.text)
            yield k + 1, start, self.text[start:end].rstrip("\r\n")

    def number(self, place: int) -> int:
        """Return the number of the line that ``place`` is in."""
        return bisect_right(self.starts, place)


def compile_possessive_spaces(pattern: str, flags: re.RegexFlag) -> re.Pattern[str]:
    """Compile a pattern whose runs of spaces are taken whole: thousands of them are not shared out in every way."""
    return re.compile(pattern.replace(r"\s*", r"\s*+").replace(r"\s+", r"\s++"), flags)


def mask_comments(text: str, comment: str, strings: str = '"') -> str:
    """Return ``text`` with remarks (regular expression ``comment``) and quoted strings blanked, places unchanged.

    So is the mark of its encoding that editors put before the first line.

    A remark that ends in an empty group ``unfinished`` stays: it is passed over once, not tried from each of its signs.
    """
    quoted = "".join(rf"|{q}[^{q}\r\n]*{q}" for q in strings)

    def blank(match: re.Match[str]) -> str:
        """Return as many blanks as a comment has letters; one that does not end stays."""
        return " " * len(match[0]) if match.groupdict().get("unfinished") is None else match[0]

    return re.sub(f"(?:{comment}){quoted}", blank, text.replace("\ufeff", " "))


def write_values(text: str, values: Iterable[tuple[Slot, float]]) -> str:
    """Return ``text`` with SI ``values`` in their slots; a number that the change does not reach stays as it is."""
    pieces, last = [], 0
    for slot, value in sorted(values, key=lambda pair: pair[0].start):
        old = text[slot.start : slot.end]
        new = number_text(old.replace(slot.decimal, "."), value / slot.unit, slot.decimals).replace(".", slot.decimal)
        gap = text[last : slot.start]
        if old and slot.aligned:
            gap = _keep_alignment(gap, len(new) - len(old))
        pieces += [gap, slot.prefix if not old else "", new]
        last = slot.end
    return "".join([*pieces, text[last:]])


def number_text(old: str, value: float, decimals: int) -> str:
    """Return ``value`` with as many decimals as ``old`` shows, or more; ``old`` itself if it says the same."""
    shown = len(old.partition(".")[2]) if "." in old and "e" not in old.lower() else 0
    places = max(decimals, shown)
    if old.startswith("'"):  # a whole number in bits or hexadecimal digits
        base, digits = (2, "b") if old[1] in "Bb" else (16, "X")
        if int(old[2:-1], base) == value:
            return old
        return f"{old[:2]}{round(value):0{len(old[2:-1].strip())}{digits}}'"
    if old and abs(float(old) - value) < 0.5 * 10.0**-places:
        return old
    text = f"{value:.{places}f}"
    text = text.lstrip("-") if float(text) == 0.0 else text
    return "+" + text if old.startswith("+") and not text.startswith("-") else text


def _keep_alignment(gap: str, growth: int) -> str:
    """Let the spaces before a number take up its growth, where there are columns: two spaces or more."""
    spaces = len(gap) - len(gap.rstrip(" "))
    if spaces < 2:
        return gap
    return gap[: len(gap) - spaces] + " " * max(1, spaces - growth)


@dataclass(frozen=True, slots=True)
class PlacedNumber:
    """A number as written, and where it begins in the text."""

    value: float
    text: str
    start: int

    def slot(self, unit: float, decimals: int, aligned: bool = True) -> Slot:
        """Return the place that a corrected number in ``unit`` goes to."""
        return Slot(self.start, self.start + len(self.text), unit, decimals, aligned=aligned)


@dataclass(frozen=True)
class Statement:
    """A statement without its remarks: line (from 1), place in the text, and what it says.

    One of this very class is not known to the reader.
    """

    line: int
    start: int
    text: str


@dataclass(frozen=True)
class Passive(Statement):
    """A known statement that neither moves the robot nor changes how it moves."""


@dataclass(frozen=True)
class Routine(Statement):
    """The begin of a routine, its name in one spelling."""

    name: str


@dataclass(frozen=True)
class RoutineEnd(Statement):
    """The end of a routine."""


@dataclass(frozen=True)
class Call(Statement):
    """The call of a routine; ``triggered``: on the way of the next move."""

    name: str
    triggered: bool = False


@dataclass(frozen=True)
class Flow(Statement):
    """A branch, a loop or a label; ``depth`` is what it adds to how deep the next statement lies."""

    depth: int = 0


@dataclass(frozen=True)
class Waiting(Statement):
    """A time of standing still: its number as written, and the unit [s]."""

    number: str
    unit: float = 1.0


@dataclass(frozen=True)
class Pulse(Statement):
    """A pulse of the output that marks a pose."""


@dataclass(frozen=True)
class Assignment(Statement):
    """A value given to a name, where it is declared or later.

    ``kind`` is the type, or empty; ``part`` the component, or empty.
    """

    kind: str
    name: str
    part: str
    value: str
    value_start: int


@dataclass(frozen=True)
class MotionStatement(Statement):
    """A motion of the robot; each language adds how it says the target."""

    word: str


def run_order(statements: Iterable[Statement], main: str | None = None) -> Iterator[Statement]:
    """Yield the statements in the order in which the controller runs them, from routine ``main`` (or the first).

    Raises:
        InputError: a routine is missing, has no end, or calls itself.
    """
    bodies: dict[str, list[Statement]] = {}
    open_routine: str | None = None
    for statement in statements:
        if isinstance(statement, Routine):
            if open_routine is not None:
                break
            open_routine = statement.name
            bodies[open_routine] = []
        elif isinstance(statement, RoutineEnd):
            open_routine = None
        elif open_routine is not None:
            bodies[open_routine].append(statement)
    start = next(iter(bodies), "main") if main is None else main
    if open_routine is not None:
        raise InputError(f"the routine {open_routine} has no end")
    if start not in bodies:
        raise InputError(f"the program has no routine {start}")
    yield from _inline_calls(bodies, start)


def _inline_calls(bodies: dict[str, list[Statement]], name: str, depth: int = 0) -> Iterator[Statement]:
    if depth > 3:
        raise InputError(f"'{name}' is called by itself")
    for statement in bodies[name]:
        if isinstance(statement, Call) and statement.name in bodies:
            yield from _inline_calls(bodies, statement.name, depth + 1)
        else:
            yield statement


def parse_fixed_point(text: str, where: str) -> float:
    """Return the number that ``text`` spells in fixed point, as every controller takes it."""
    if not re.fullmatch(r"-?[0-9]+(\.[0-9]*)?", text):
        raise InputError(f"{where}: '{text}' is no number in fixed point")
    return float(text)


def placed_numbers(text: str, start: int, pattern: str) -> list[PlacedNumber]:
    """Return the numbers in ``text``, which begins at ``start``, in order."""
    return [PlacedNumber(float(m[0]), m[0], start + m.start()) for m in re.finditer(pattern, text)]
