"""What a program makes the robot do, noted while its statements are executed in the controller's order."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only


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


@dataclass
class ExecutionTrace:
    """Collects moves, stops, dwells and pulses."""

    rows: list[list[float]] = field(default_factory=list)
    blends: list[float | None] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    dwells: list[float] = field(default_factory=list)
    syncs: int = 0
    centrings: list[tuple[int, int, int]] = field(default_factory=list)

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
        )


def parse_fixed(text: str, where: str) -> float:
    """Return the number that ``text`` spells in fixed point, as every controller takes it."""
    if not re.fullmatch(r"-?\d+(\.\d*)?", text):
        raise InputError(f"{where}: '{text}' is no number in fixed point")
    return float(text)


def plan_id_of(texts: tuple[str, ...]) -> str:
    """Return the plan_id that every one of the files names in a comment."""
    found: set[str] = {m for text in texts for m in re.findall(r"plan_id:\s*([0-9a-f]{12})\b", text)}
    unnamed = [n for n, text in enumerate(texts, start=1) if "plan_id:" not in text]
    if len(found) != 1 or unnamed:
        raise InputError(f"every file must name the same plan_id, found {sorted(found) or 'none'}")
    return found.pop()


Body = list[str]


def inline_calls(
    bodies: dict[str, Body], start: str, called: Callable[[str], str | None], depth: int = 0
) -> Iterator[str]:
    """Yield the statements of ``bodies[start]``, with each call replaced by what it runs."""
    if depth > 3:
        raise InputError(f"'{start}' is called by itself")
    for statement in bodies[start]:
        name = called(statement)
        if name is not None and name in bodies:
            yield from inline_calls(bodies, name, called, depth + 1)
        else:
            yield statement
