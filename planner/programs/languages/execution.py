"""What a program makes the robot do, noted while its statements are run."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.statements import Call, Pulse, Routine, RoutineEnd, Statement, Waiting, parse_fixed


@dataclass(frozen=True)
class ReadBack:
    """What a program makes the robot do, in the order of execution."""

    plan_id: str
    joint_path_deg: Array
    """(n, N) angles of the controller, one row a move [deg]."""
    blends: tuple[float | None, ...]
    """One entry a move: None for an exact stop, else the number that the dialect rounds the corner with."""
    speeds: tuple[float, ...]
    """One entry a move: the number of its speed word, in the dialect's unit, overrides multiplied in."""
    dwells_s: tuple[float, ...]
    """Times of standing still [s]."""
    syncs: int
    """Number of pulses at measuring poses."""
    centrings: tuple[tuple[int, int, int], ...] = ()
    """Calls of the centring routine: after how many moves, at which ball and which pose."""
    stretches: tuple[tuple[int, int], ...] = ()
    """Stretches that a later start leaves out: up to which start, and how many moves come before."""
    entries: tuple[tuple[int, Array, tuple[float, ...]], ...] = ()
    """Ways to a start in the middle: which, the angles (k, N) of their exact stops [deg], and the speed words."""
    circles: tuple[tuple[int, tuple[float, ...]], ...] = ()
    """Moves that are circles of the tool, whose speed is in mm/s: which, and the angles of the middle point [deg]."""
    unknown: tuple[Statement, ...] = ()
    """Statements that are neither a known motion, speed or signal nor one that the dialect's own file lists."""


class Branches:
    """The branches of ``[resume]`` as patterns, and whether the reader stands inside one."""

    def __init__(self, patterns: dict[str, re.Pattern[str]]) -> None:
        self.patterns = patterns
        self.inside: str | None = None

    @classmethod
    def of(cls, dialect: Dialect) -> "Branches":
        """Return the branches of a dialect, none where it has no ``[resume]``."""
        style = dialect.resume
        if style is None:
            return cls({})
        texts = {"stretch": style.stretch, "entry": style.entry, "end": style.end}
        return cls({kind: _branch_pattern(text) for kind, text in texts.items()})

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


class Execution(ABC):
    """Runs a program's statements and notes moves, stops, dwells and pulses; one subclass a language.

    A subclass remembers what the controller does between statements, as far as it decides what a move does, and says
    what reads the statements of a file.
    """

    parse_file: Callable[[str], Iterable[Statement]]

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        self.dialect, self.program = dialect, program
        self.moves: list[tuple[list[float], float | None, float]] = []
        self.dwells: list[float] = []
        self.syncs = 0
        self.centrings: list[tuple[int, int, int]] = []
        self.unknown: list[Statement] = []
        self.stretches: list[tuple[int, int]] = []
        self.entries: list[tuple[int, list[tuple[list[float], float | None, float]]]] = []
        self.circles: list[tuple[int, tuple[float, ...]]] = []
        self.branches = Branches.of(dialect)
        self.entered: tuple[list[tuple[list[float], float | None, float]], float, int, int] | None = None

    def forget(self, stopped: bool) -> None:
        """Forget the words that a later start may have left unsaid, at a ``stopped`` robot those of the stop too."""
        del stopped  # a language whose moves say everything remembers nothing

    @property
    def overall_speed(self) -> float:
        """Return what scales all speeds [%]."""
        return 100.0

    def parse(self, texts: Sequence[str]) -> Iterable[Statement]:
        """Return every statement of the files ``texts``, run or not."""
        return (statement for text in texts for statement in self.parse_file(text))

    def order(self, statements: Sequence[Statement]) -> Iterator[Statement]:
        """Yield statements in the order in which the controller runs them."""
        yield from statements

    @abstractmethod
    def execute(self, statement: Statement) -> bool:
        """Take in one statement, and return whether it decides how the robot moves.

        Raises:
            InputError: a motion that is not a joint move as this family writes it.
        """

    def run(self, texts: Sequence[str]) -> None:
        """Note what the program in ``texts`` does, and every statement that is not on the list of known ones."""
        statements = list(self.parse(texts))
        understood = set[int]()
        for statement in self.order(statements):
            if self._branch(statement):
                understood.add(id(statement))
                continue
            match statement:
                case Waiting(number=number, unit=unit):
                    self.dwell(parse_fixed(number, statement.text) * unit)
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
        """Take in a branch on where the operator starts, and return whether the statement was one."""
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
            self.forget(stopped=not self.moves or self.moves[-1][1] is None)
        return True

    def _leave_entry(self, where: str) -> None:
        if self.entered is None:
            return
        self.moves, speed, dwells, syncs = self.entered
        stopped = not self.moves or self.moves[-1][1] is None
        if (len(self.dwells), self.syncs) != (dwells, syncs) or not (stopped or self.overall_speed == speed):
            raise InputError(f"{where}: the way to a start measures, or leaves another override than the path has")
        self.entered = None

    def move(self, angles_deg: list[float], blend: float | None, speed: float) -> None:
        """Note a joint move; all moves must drive the same number of axes."""
        if self.moves and len(angles_deg) != len(self.moves[0][0]):
            before = len(self.moves[0][0])
            raise InputError(f"move {len(self.moves) + 1} drives {len(angles_deg)} axes, those before {before}")
        self.moves.append((angles_deg, blend, speed))

    def circle(self, via_deg: list[float], angles_deg: list[float], blend: float | None, speed: float) -> None:
        """Note a circle of the tool through a middle point; ``speed`` in mm/s."""
        if self.entered is not None or len(via_deg) != len(angles_deg):
            raise InputError(f"move {len(self.moves) + 1} is a circle where none can be")
        self.circles.append((len(self.moves), tuple(via_deg)))
        self.move(angles_deg, blend, speed)

    def dwell(self, seconds: float) -> None:
        """Note a dwell; one of no time only empties the controller's look-ahead and is no dwell."""
        if seconds > 0.0:
            self.dwells.append(seconds)

    def result(self, plan_id: str) -> ReadBack:
        """Return what was noted."""
        if not self.moves:
            raise InputError("the program holds no joint move")
        angles, blends, speeds = zip(*self.moves, strict=True)
        path, unknown = read_only(np.array(angles)), tuple(self.unknown)
        entries = tuple(
            (at, read_only(np.array([m[0] for m in moves])), tuple(m[2] for m in moves)) for at, moves in self.entries
        )
        return ReadBack(
            plan_id, path, blends, speeds, tuple(self.dwells), self.syncs, tuple(self.centrings),
            tuple(self.stretches), entries, tuple(self.circles), unknown,
        )  # fmt: skip


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
