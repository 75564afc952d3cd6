"""What a program makes the robot do, noted while its statements are run."""

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program, StopKind
from planner.programs.languages.statements import (
    Call,
    Flow,
    Pulse,
    Routine,
    RoutineEnd,
    Statement,
    Waiting,
    parse_fixed_point,
)


@dataclass(frozen=True)
class ReadMove:
    """A joint move, or a circle of the tool, as a program says it."""

    angles_deg: tuple[float, ...]
    """Of the controller, at the end [deg]."""
    blend: float | None
    """None for an exact stop, else the number that the dialect rounds the corner with."""
    speed: float
    """The number of its speed word, in the dialect's unit, any reduction multiplied in; of a circle in mm/s."""
    via_deg: tuple[float, ...] | None = None
    """At the middle point of a circle [deg]."""
    peak: float = 1.0
    """Largest over mean speed on the leg, of the joint that moves furthest, where the program itself says it."""


@dataclass(frozen=True)
class ReadBack:
    """What a program makes the robot do, in the order of execution."""

    plan_id: str
    moves: tuple[ReadMove, ...]
    dwells_s: tuple[float, ...]
    """Times of standing still [s]."""
    syncs: int
    """Number of pulses at measuring poses."""
    centrings: tuple[tuple[int, int, int], ...] = ()
    """Calls of the centring routine: after how many moves, at which ball and which pose."""
    stretches: tuple[tuple[int, int], ...] = ()
    """Stretches that a later start leaves out: up to which start, and how many moves come before."""
    entries: tuple[tuple[int, tuple[ReadMove, ...]], ...] = ()
    """Ways to a start in the middle: which, and their exact stops."""
    acceleration_deg_s2: tuple[float, ...] = ()
    """Largest of each joint where the program itself says how the joints speed up, beyond what rounding explains."""
    stops: tuple[tuple[StopKind, int], ...] = ()
    """Where the program waits for a person or an input: which, and after how many moves."""
    unknown: tuple[Statement, ...] = ()
    """Statements that are neither a known motion, speed or signal nor one that the dialect's own file lists."""

    @property
    def joint_path_deg(self) -> Array:
        """Return the angles of the controller, (n, N), one row a move [deg]."""
        return read_only(np.array([m.angles_deg for m in self.moves]))


class Branches:
    """The branches of ``[resume]`` as patterns, and whether the reader stands inside one."""

    def __init__(self, dialect: Dialect) -> None:
        style = dialect.resume
        texts = {} if style is None else {"stretch": style.stretch, "entry": style.entry, "end": style.end}
        self.patterns = {kind: _branch_pattern(text) for kind, text in texts.items()}
        self.inside: str | None = None

    def find(self, said: str) -> tuple[str, int]:
        """Return the kind of branch that a statement is, or an empty text, and the number that it compares with.

        An end is one only of the branch that is open.
        """
        for kind, pattern in self.patterns.items():
            match = pattern.fullmatch(" ".join(said.split()))
            if match is None:
                continue
            found = match.groupdict()
            own = found.get("number") or ""
            if kind == "end" and self.inside != own:
                break
            self.inside = None if kind == "end" else own
            return kind, int(found.get("value") or 0)
        return "", 0


def _branch_pattern(text: str) -> re.Pattern[str]:
    said = re.escape(" ".join(text.split()))
    for word, pattern in (("until", r"(?P<value>\d+)"), ("at", r"(?P<value>\d+)"), ("number", r"(?P<number>\d+)"),
                          ("ID", "[0-9A-F]{12}"), ("id", "[0-9a-f]{12}")):  # fmt: skip
        said = said.replace(rf"\{{{word}\}}", pattern)
    return re.compile(said, re.IGNORECASE)


class StopLines:
    """Finds the dialect's lines ``pause`` and ``wait`` among the statements of a program, one after the other."""

    def __init__(
        self, dialect: Dialect, parse: Callable[[Sequence[str]], Iterable[Statement]], program: Program | None
    ) -> None:
        kinds: tuple[tuple[StopKind, tuple[str, ...]], ...] = (("pause", dialect.pause), ("wait", dialect.wait))
        self.patterns: dict[StopKind, list[re.Pattern[str]]] = {}
        for kind, lines in kinds:
            text = (_with_numbers("\n".join(lines), dialect, program) or "").replace("{number}", ANY)
            said = [re.escape(_squeeze(s.text)).replace(ANY, r"\d+") for s in parse((text,))] if text else []
            if said:
                self.patterns[kind] = [re.compile(t, re.IGNORECASE) for t in said]
        self.last: deque[str] = deque(maxlen=max(map(len, self.patterns.values()), default=0))

    def find(self, statement: Statement) -> StopKind | None:
        """Return for what the program waits where this statement is the last of such lines."""
        self.last.append(_squeeze(statement.text))
        said = list(self.last)
        for kind, patterns in self.patterns.items():
            tail = said[-len(patterns) :]
            if len(tail) == len(patterns) and all(p.fullmatch(t) for p, t in zip(patterns, tail, strict=True)):
                self.last.clear()
                return kind
        return None


class Execution(ABC):
    """Runs a program's statements and notes moves, stops, dwells and pulses; one subclass a language.

    A subclass remembers what the controller does between statements, as far as it decides what a move does, and says
    what reads the statements of a file. Its ``family`` is the name by which dialects ask for it.
    """

    families: ClassVar[dict[str, type["Execution"]]] = {}
    pulses_per_deg: tuple[float, ...] = ()
    parse_file: Callable[[str], Iterable[Statement]]

    def __init_subclass__(cls, family: str = "", **others: object) -> None:
        super().__init_subclass__(**others)
        if family:
            Execution.families[family] = cls

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        self.dialect, self.program = dialect, program
        self.moves: list[ReadMove] = []
        self.dwells: list[float] = []
        self.syncs = 0
        self.centrings: list[tuple[int, int, int]] = []
        self.unknown: list[Statement] = []
        self.acceleration: tuple[float, ...] = ()
        self.stretches: list[tuple[int, int]] = []
        self.entries: list[tuple[int, list[ReadMove]]] = []
        self.branches = Branches(dialect)
        self.stops: list[tuple[StopKind, int]] = []
        self.entered: tuple[list[ReadMove], float, int, int] | None = None

    def forget(self, stopped: bool) -> None:
        """Forget the words that a later start may have left unsaid, at a ``stopped`` robot those of the stop too."""
        del stopped  # a language whose moves say everything remembers nothing

    @property
    def overall_speed(self) -> float:
        """Return by what the program itself scales all its speeds [%]."""
        return 100.0

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the program's names of its joints; none where they are not known."""
        return () if self.program is None else self.program.joint_names or self.dialect.axes[: self.program.n_joints]

    @property
    def _stopped(self) -> bool:
        return not self.moves or self.moves[-1].blend is None

    def parse(self, texts: Sequence[str]) -> Iterable[Statement]:
        """Return every statement of the files ``texts``, run or not."""
        return (statement for text in texts for statement in self.parse_file(text))

    def order(self, statements: Sequence[Statement]) -> Iterator[Statement]:
        """Yield statements in the order in which the controller runs them."""
        yield from statements

    @abstractmethod
    def execute(self, statement: Statement) -> bool:
        """Process one statement, and return whether it decides how the robot moves.

        Raises:
            InputError: a motion that is not a joint move as this family writes it.
        """

    def run(self, texts: Sequence[str]) -> None:
        """Note what the program in ``texts`` does, and every statement that is not on the list of known ones."""
        statements = list(self.parse(texts))
        understood = set[int]()
        waits, depth = StopLines(self.dialect, self.parse, self.program), 0
        for statement in self.order(statements):
            if self._branch(statement):
                understood.add(id(statement))
                continue
            depth += statement.depth if isinstance(statement, Flow) else 0
            if (kind := waits.find(statement)) and depth == 0:  # a loop of the program's own halts on an error alone
                self.stops.append((kind, len(self.moves)))
            match statement:
                case Waiting(number=number, unit=unit):
                    self.dwell(parse_fixed_point(number, statement.text) * unit)
                    understood.add(id(statement))
                case Pulse():
                    self.syncs += 1
                case _ if self.execute(statement):
                    understood.add(id(statement))
        known = known_statements(self.dialect, self.parse, self.program)
        routines = {s.name for s in statements if isinstance(s, Routine)}
        for statement in statements:
            structure = isinstance(statement, Routine | RoutineEnd)
            called = isinstance(statement, Call) and statement.name in routines
            if not (structure or called or id(statement) in understood or known(statement)):
                self.unknown.append(statement)

    def _branch(self, statement: Statement) -> bool:
        """Process a branch on where the operator starts, and return whether the statement was one."""
        open_before = self.branches.inside is not None
        kind, number = self.branches.find(statement.text)
        if kind == "":
            return False
        where = f"line {statement.line}: '{statement.text}'"
        if kind != "end" and open_before:
            raise InputError(f"{where} begins a branch inside another")
        if kind == "end":
            self._leave_entry(where)
        elif kind == "entry":
            self.entered = (self.moves, self.overall_speed, len(self.dwells), self.syncs)
            self.moves = []
            self.entries.append((number, self.moves))
            self.forget(stopped=True)
        else:
            self.stretches.append((number, len(self.moves)))
            self.forget(stopped=self._stopped)
        return True

    def _leave_entry(self, where: str) -> None:
        if self.entered is None:
            return
        self.moves, speed, dwells, syncs = self.entered
        if (len(self.dwells), self.syncs) != (dwells, syncs) or not (self._stopped or self.overall_speed == speed):
            raise InputError(
                f"{where}: the path to a start measures, or leaves another reduction of the speed than the path has"
            )
        self.entered = None

    def move(
        self,
        angles_deg: Sequence[float],
        blend: float | None,
        speed: float,
        via_deg: Sequence[float] | None = None,
        *,
        peak: float = 1.0,
    ) -> None:
        """Note a joint move, or with ``via_deg`` a circle of the tool; all must drive the same number of axes."""
        number, n_axes = len(self.moves) + 1, len(angles_deg)
        if via_deg is not None and (self.entered is not None or len(via_deg) != n_axes):
            raise InputError(f"move {number} is a circle where none can be")
        if self.moves and n_axes != (before := len(self.moves[0].angles_deg)):
            raise InputError(f"move {number} drives {n_axes} axes, those before {before}")
        self.moves.append(ReadMove(tuple(angles_deg), blend, speed, None if via_deg is None else tuple(via_deg), peak))

    def dwell(self, seconds: float) -> None:
        """Note a dwell; one of no time only empties the controller's look-ahead and is no dwell."""
        if seconds > 0.0:
            self.dwells.append(seconds)

    def result(self, plan_id: str) -> ReadBack:
        """Return the program as read."""
        if not self.moves:
            raise InputError("the program holds no joint move")
        entries = tuple((at, tuple(moves)) for at, moves in self.entries)
        return ReadBack(
            plan_id, tuple(self.moves), tuple(self.dwells), self.syncs, tuple(self.centrings),
            tuple(self.stretches), entries, self.acceleration, tuple(self.stops), tuple(self.unknown),
        )  # fmt: skip


ANY = "987654321"  # stands for any number in a line of the dialect while it is parsed
NUMBERS = ("tool", "base", "load")


def known_statements(
    dialect: Dialect, parse: Callable[[Sequence[str]], Iterable[Statement]], program: Program | None
) -> Callable[[Statement], bool]:
    """Return a test for known statements: the dialect's own lines and its ``passive`` patterns.

    Args:
        dialect: whose file lists the lines and patterns.
        parse: of the dialect's reader, so that a line looks as it does in a program.
        program: only its own tool, base, load and signals are known; without one any number is.
    """
    lines = (s.text for text in _own_lines(dialect, program) for s in parse((text,)))
    texts = [re.escape(_squeeze(line)) for line in lines]
    circles = dialect.circle.passive if dialect.circle and (program is None or program.has_circles) else ()
    texts += [
        p for text in (*dialect.reading.passive, *circles) if (p := _with_numbers(text, dialect, program)) is not None
    ]
    patterns = [re.compile(text.replace(ANY, r"\d+"), re.IGNORECASE) for text in dict.fromkeys(texts)]

    @cache
    def is_known(said: str) -> bool:
        """Tell whether a statement is on the dialect's list."""
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
        """Return the number that the program gives under a key of the controller; any, where there is no program."""
        found = int(ANY) if program is None else getattr(program.controller, key)
        return None if found is None else int(found)

    for name in NUMBERS:
        if f"{{{name}}}" in text and (chosen := number(name)) is not None:
            text = text.replace(f"{{{name}}}", str(chosen))
    text = dialect.fill(text, number("sync_output"), number("gauge_input"))
    return None if re.search(r"\{(tool|base|load|output|input)\}", text) else text


def _squeeze(text: str) -> str:
    return " ".join(text.split())
