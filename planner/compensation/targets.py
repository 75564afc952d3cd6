"""What a file asks the robot to do, whatever its language: joint targets and poses, and where their numbers stand."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from planner.common.errors import InputError
from planner.common.units import DEG, Array, read_only
from planner.kinematics.robot import Robot
from planner.programs.languages.statements import PlacedNumber
from planner.programs.languages.text import Slot

Note = tuple[int, str]
"""A line of the file, and what is to be said of it."""

SHOWN_LINES = 20  # refused lines that one message lists
MM_DECIMALS, DEG_DECIMALS = 4, 5  # fewest digits of a number that is written anew
EXTERNAL_NOTE = "external axes are moved: they are kept, and the robot's own base is taken as standing still"


class Configuration(Protocol):
    """Which of the arm's ways to reach a pose is meant, as the language says it."""

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape, see :mod:`planner.compensation.arm_shapes`; None where any will do."""

    def turns(self, q: Array) -> np.ndarray:
        """Return for angles (n, N) [rad] whether each joint is in the turn that is meant, (n, N) bool."""

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return the numbers that say the corrected configuration.

        Args:
            before, after: the arm's shape at the nominal and at the corrected angles.
            q, q_new: nominal and corrected angles, (N,) [rad].
        """


@dataclass(frozen=True)
class CartesianTarget:
    """A Cartesian target.

    Attributes:
        T_BT: pose of the tool in its base, (4, 4) [m].
        spelling: ``abc`` (Z-Y'-X" angles) or ``quaternion`` (scalar first).
        words: orientation as written, 3 angles [rad] or 4 numbers; the corrected one is written nearest to it.
        T_WB, T_FT: base in the robot's own frame, tool in the flange, (4, 4) [m].
        configuration: which way to reach it, or None: then ``start`` or the target before says it.
        start: joint angles near the wanted ones [rad], or None.
    """

    T_BT: Array
    spelling: str
    words: Array
    T_WB: Array
    T_FT: Array
    configuration: Configuration | None = None
    start: Array | None = None


@dataclass(frozen=True)
class Target:
    """One target in a file.

    Attributes:
        line: where it stands, from 1.
        slots: places of the numbers: N joint angles, or 3 + 3 (or 4) of a pose and then those of its configuration
            (or, with a start, of its joint angles).
        q: joint angles as written (N,) [rad], or None for a pose.
        pose: the pose, or None for joint angles.
        follows: index of the target that the arm comes from, for a pose without configuration.
    """

    line: int
    slots: tuple[Slot, ...]
    q: Array | None = None
    pose: CartesianTarget | None = None
    follows: int | None = None


@dataclass(frozen=True)
class ToolAndBase:
    """Tool and base of Cartesian targets, where the file itself does not say them.

    Attributes:
        T_FT: tool in the flange, (4, 4) [m], or None.
        T_WB: base in the robot's own frame, (4, 4) [m], or None.
        data: text of the controller's own table of frames (KUKA ``$config.dat``, a RAPID module).
    """

    T_FT: Array | None = None
    T_WB: Array | None = None
    data: str = ""


@dataclass
class TargetReading:
    """What a reader of a language works with, and what it notes.

    Attributes:
        name: of the file.
        robot: the nominal robot.
        axes: names of the robot's joints in this language.
        frames: tool and base that the person has named, for files that do not say them.
        targets: found so far.
        refused: (line, sentence) of what is not understood, collected so that a person sees all at once.
        notes: (line, sentence) that the person should know.
    """

    name: str
    robot: Robot
    frames: ToolAndBase
    axes: tuple[str, ...] = ()
    targets: list[Target] = field(default_factory=list)
    refused: list[Note] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)

    def refuse(self, line: int, sentence: str) -> None:
        """Note that ``line`` cannot be compensated, and why."""
        if (line, sentence) not in self.refused:
            self.refused.append((line, sentence))

    def check(self) -> None:
        """Raise what was refused.

        Raises:
            InputError: one sentence a line.
        """
        if self.refused:
            raise InputError("\n".join(list_lines(self.name, self.refused)))

    def add_joints(self, line: int, found: Sequence[PlacedNumber]) -> None:
        """Note a joint target with its angles in degrees."""
        slots = tuple(number.slot(DEG, DEG_DECIMALS) for number in found)
        self.targets.append(Target(line, slots, q=read_only(np.array([number.value for number in found]) * DEG)))


FramePair = tuple[Array | None, Array | None]
"""Tool in the flange and base in the robot's own frame, None where they are not known."""


@dataclass
class DeclaredPose:
    """A pose declared by name: its line, its value as the language has it, and the frames of the moves that use it."""

    line: int
    value: Any
    frames: list[Any] = field(default_factory=list)


class PointTable:
    """Positions by name: which a file declares, where moves use them, and where the program computes them."""

    def __init__(self, reading: TargetReading, container: str) -> None:
        self.reading, self.container = reading, container
        self.poses: dict[str, DeclaredPose] = {}
        self.declared: set[str] = set()
        self.assigned: dict[str, int] = {}
        self._used: dict[str, int] = {}

    def declare(self, name: str, pose: DeclaredPose | None = None) -> None:
        """Note that the file declares ``name``; without ``pose`` its value is of another kind."""
        self.declared.add(name)
        if pose is not None:
            self.poses[name] = pose

    def use(self, name: str, line: int, frames: object) -> None:
        """Note that the move in ``line`` goes to ``name``."""
        self._used.setdefault(name, line)
        if name in self.poses:
            self.poses[name].frames.append(frames)

    def check(self) -> None:
        """Refuse the use of points that the program computes, and note those that are declared elsewhere."""
        for name in self._used.keys() & self.assigned.keys():
            sentence = f"{name} is computed while the program runs (line {self.assigned[name]})"
            self.reading.refuse(self._used[name], sentence)
        for name, line in sorted(self._used.items(), key=lambda item: item[1]):
            if name not in self.declared and name not in self.assigned:
                sentence = f"{name} is declared elsewhere: compensate the {self.container} that declares it too"
                self.reading.notes.append((line, sentence))


def common_frames(frames: Sequence[FramePair]) -> FramePair:
    """Return tool and base if all moves to a point agree about both, else neither."""
    for one, other in ((frames[0][k], pair[k]) for pair in frames[1:] for k in (0, 1)):
        if one is None or other is None or not np.array_equal(one, other):
            return None, None
    return frames[0]


def list_lines(name: str, lines: Iterable[Note]) -> Iterator[str]:
    """Yield ``name:line: sentence`` in the order of the file, the first of many and the count of the rest."""
    ordered = sorted(lines)
    yield from (f"{name}:{line}: {sentence}" for line, sentence in ordered[:SHOWN_LINES])
    if len(ordered) > SHOWN_LINES:
        yield f"{name}: and {len(ordered) - SHOWN_LINES} more lines like these"
