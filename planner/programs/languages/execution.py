"""What a program makes the robot do, noted while its statements are run."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.known import known_statements
from planner.programs.languages.statements import (
    Call,
    Pulse,
    Routine,
    RoutineEnd,
    Statement,
    Waiting,
    parse_fixed,
)


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
    unknown: tuple[Statement, ...] = ()
    """Statements that are neither a known motion, speed or signal nor one that the dialect's own file lists."""


class Execution(ABC):
    """Runs a program's statements and notes moves, stops, dwells and pulses; one subclass a language.

    A subclass remembers what the controller does between statements, as far as it decides what a move does.
    """

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        self.dialect, self.program = dialect, program
        self.moves: list[tuple[list[float], float | None, float]] = []
        self.dwells: list[float] = []
        self.syncs = 0
        self.centrings: list[tuple[int, int, int]] = []
        self.unknown: list[Statement] = []

    @abstractmethod
    def parse(self, texts: Sequence[str]) -> Iterable[Statement]:
        """Return every statement of the files ``texts``, run or not."""

    @abstractmethod
    def order(self, statements: Sequence[Statement]) -> Iterator[Statement]:
        """Yield statements in the order in which the controller runs them."""

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

    def move(self, angles_deg: list[float], blend: float | None, speed: float) -> None:
        """Note a joint move; all moves must drive the same number of axes."""
        if self.moves and len(angles_deg) != len(self.moves[0][0]):
            before = len(self.moves[0][0])
            raise InputError(f"move {len(self.moves) + 1} drives {len(angles_deg)} axes, those before {before}")
        self.moves.append((angles_deg, blend, speed))

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
        return ReadBack(plan_id, path, blends, speeds, tuple(self.dwells), self.syncs, tuple(self.centrings), unknown)
