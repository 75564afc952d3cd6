"""What the reader of every language yields: statements and numbers with their places, run in the controller's order."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from planner.common.errors import InputError
from planner.programs.languages.text import Slot


@dataclass(frozen=True)
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


def parse_fixed(text: str, where: str) -> float:
    """Return the number that ``text`` spells in fixed point, as every controller takes it."""
    if not re.fullmatch(r"-?\d+(\.\d*)?", text):
        raise InputError(f"{where}: '{text}' is no number in fixed point")
    return float(text)


def placed_numbers(text: str, start: int, pattern: str) -> list[PlacedNumber]:
    """Return the numbers in ``text``, which begins at ``start``, in order."""
    return [PlacedNumber(float(m[0]), m[0], start + m.start()) for m in re.finditer(pattern, text)]
