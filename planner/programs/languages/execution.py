"""What a program makes the robot do, noted while its statements are run."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.programs.languages.statements import Machine, Pulse, Statement, Waiting, parse_fixed


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


@dataclass
class ExecutionTrace:
    """Collects moves, stops, dwells and pulses."""

    rows: list[list[float]] = field(default_factory=list)
    blends: list[float | None] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    dwells: list[float] = field(default_factory=list)
    syncs: int = 0
    centrings: list[tuple[int, int, int]] = field(default_factory=list)
    unknown: list[Statement] = field(default_factory=list)

    def run(self, statements: Iterable[Statement], machine: Machine) -> None:
        """Note what statements do, in the order in which the controller runs them."""
        for statement in statements:
            match statement:
                case Waiting(number=number, unit=unit):
                    self.dwell(parse_fixed(number, statement.text) * unit)
                case Pulse():
                    self.syncs += 1
                case _ if not machine.execute(statement):
                    self.unknown.append(statement)

    def move(self, angles_deg: list[float], blend: float | None, speed: float) -> None:
        """Note a joint move; all moves must drive the same number of axes."""
        if self.rows and len(angles_deg) != len(self.rows[0]):
            raise InputError(
                f"move {len(self.rows) + 1} drives {len(angles_deg)} axes, those before {len(self.rows[0])}"
            )
        self.rows.append(angles_deg)
        self.blends.append(blend)
        self.speeds.append(speed)

    def dwell(self, seconds: float) -> None:
        """Note a dwell; one of no time only empties the controller's look-ahead and is no dwell."""
        if seconds > 0.0:
            self.dwells.append(seconds)

    def centring(self, ball: int, pose: int) -> None:
        """Note a call of the centring routine."""
        self.centrings.append((len(self.rows), ball, pose))

    def finished(self, plan_id: str) -> ReadBack:
        """Return what was noted."""
        if not self.rows:
            raise InputError("the program holds no joint move")
        return ReadBack(
            plan_id,
            read_only(np.array(self.rows)),
            tuple(self.blends),
            tuple(self.speeds),
            tuple(self.dwells),
            self.syncs,
            tuple(self.centrings),
            tuple(self.unknown),
        )
