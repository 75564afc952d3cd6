"""What a program makes the robot do, noted while its statements are run."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.programs.dialect import Dialect
from planner.programs.languages.statements import Pulse, Statement, Waiting, parse_fixed


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
    """Statements that the reader does not know and has passed over."""


class Execution(ABC):
    """Runs a program's statements and notes moves, stops, dwells and pulses; one subclass a language.

    A subclass remembers what the controller does between statements, as far as it decides what a move does.
    """

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.moves: list[tuple[list[float], float | None, float]] = []
        self.dwells: list[float] = []
        self.syncs = 0
        self.centrings: list[tuple[int, int, int]] = []
        self.unknown: list[Statement] = []

    @abstractmethod
    def statements(self, texts: Sequence[str]) -> Iterator[Statement]:
        """Yield the statements of the files ``texts`` in the order in which the controller runs them."""

    @abstractmethod
    def execute(self, statement: Statement) -> bool:
        """Take in one statement, and return whether it is known.

        Raises:
            InputError: a motion that is not a joint move as this family writes it.
        """

    def run(self, texts: Sequence[str]) -> None:
        """Note what the program in the files ``texts`` does."""
        for statement in self.statements(texts):
            match statement:
                case Waiting(number=number, unit=unit):
                    self.dwell(parse_fixed(number, statement.text) * unit)
                case Pulse():
                    self.syncs += 1
                case _ if not self.execute(statement):
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
