"""What a file asks the robot to do, whatever its language: joint targets and poses, and where their numbers stand."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from planner.common.errors import InputError
from planner.common.units import DEG, Array, read_only
from planner.compensation.tolerances import FARTHEST
from planner.kinematics.robot import Robot
from planner.programs.languages.statements import PlacedNumber, Slot

Note = tuple[int, str]
"""A line of the file, and what is to be said of it."""

MM_DECIMALS = 4  # fewest of a number in mm that is written anew: a tenth of a micrometre
DEG_DECIMALS = 5  # fewest of a number in degrees: the same at 600 mm
EXTERNAL = "external axes are not at zero: the file does not say whether they carry the robot or the part"
NOT_HELD = "is not in the files"  # what is said of a tool or a base that a program names, and its files do not hold
_NOT_HELD = re.compile(rf"(\S+(?: \d+)?) (?:{NOT_HELD}|is not declared)")
FOLLOWS_NONE = "the target that it follows is not known here, and with it the shape of the arm"


class Configuration(Protocol):
    """Which of the arm's ways to reach a pose is meant, as the language says it."""

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape, see :mod:`planner.compensation.arm_shapes`; None where any will do."""

    def turns(self, q: Array) -> np.ndarray:
        """Return for angles (n, N) [rad] whether each joint is in the turn that is meant, (n, N) bool."""

    def correct_numbers(self, arm: "CorrectedArm") -> tuple[int, ...]:
        """Return the numbers that say the corrected configuration: as written where they hold, else of ``arm``."""


@dataclass(frozen=True)
class CorrectedArm:
    """Where the arm stands at one corrected target.

    Attributes:
        q: corrected angles, (N,) [rad].
        margins: how clearly the arm has each bit of its shape, (3,), see ``shape_margins``.
        q_slack, margins_slack: nearer to a border than this, what is written holds; a joint that the correction has
            not moved stands as well as it did.
    """

    q: Array
    margins: Array
    q_slack: Array
    margins_slack: Array


@dataclass(frozen=True)
class CartesianTarget:
    """A Cartesian target.

    Attributes:
        T_BT: pose of the tool in its base, (4, 4) [m].
        spelling: ``quaternion`` (scalar first), or the axes of three angles as scipy names them (``ZYX`` of A, B, C;
            small letters: about fixed axes).
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


@dataclass(frozen=True, slots=True)
class Target:
    """One target in a file.

    Attributes:
        line: where it stands, from 1.
        slots: places of the numbers: N joint angles, or 3 + 3 (or 4) of a pose and then those of its configuration
            (or, with a start, of its joint angles).
        q: joint angles as written (N,) [rad], or None for a pose.
        pose: the pose, or None for joint angles.
        follows: indices of the targets that the arm comes from, for a pose without configuration; all must agree.
        straight: indices of those that it comes from in a line or a circle, where its configuration is written too.
        p_FM: tool point in the flange (3,) [m] with which joint angles are driven, where the program says one.
        unknown_tool: name of the tool with which joint angles are driven, where the program selects one that no file of
            it holds.
        ahead: (joint, place) of its joint angles that stand once more in the block before, where some axes go first.
    """

    line: int
    slots: tuple[Slot, ...]
    q: Array | None = None
    pose: CartesianTarget | None = None
    follows: tuple[int, ...] = ()
    straight: tuple[int, ...] = ()
    p_FM: Array | None = None
    unknown_tool: str = ""
    ahead: tuple[tuple[int, Slot], ...] = ()

    @property
    def tool_point(self) -> Array | None:
        """The tool point in the flange (3,) [m] that the program says, or None."""
        return self.p_FM if self.pose is None else self.pose.T_FT[:3, 3]

    @property
    def is_sensible(self) -> bool:
        """Tell whether all its numbers are finite and as large as a robot's may be."""
        frames = () if self.pose is None else (self.pose.T_BT, self.pose.T_WB, self.pose.T_FT)
        return all(bool((np.abs(x) < FARTHEST).all()) for x in (() if self.q is None else (self.q,)) + frames)


@dataclass(frozen=True)
class ToolAndBase:
    """Tool and base of Cartesian targets, where the file itself does not say them.

    Attributes:
        T_FT: tool in the flange, (4, 4) [m], or None.
        T_WB: base in the robot's own frame, (4, 4) [m], or None.
        data: text of the controller's own table of frames (KUKA ``$config.dat``, a RAPID module).
        uncorrected: somebody has said that the controller's own accuracy model is off.
        p_FM: the measured tool point of the calibrated robot in the flange, (3,) [m], where its file has one.
    """

    T_FT: Array | None = None
    T_WB: Array | None = None
    data: str = ""
    uncorrected: bool = False
    p_FM: Array | None = None


def group_tool_points(points: Sequence[Array]) -> tuple[Array, np.ndarray]:
    """Return the tool points (k, 3) [m] that differ, and which of them each of ``points`` (n, 3) is, (n,) int."""
    tools, which = np.unique(np.round(points, 7), axis=0, return_inverse=True)  # 7: decimals, a ten thousandth of a mm
    return tools, which.ravel()


@dataclass
class TargetReading:
    """What a reader of a language works with, and what it notes.

    Attributes:
        name: of the file.
        robot: the nominal robot.
        axes: names of the robot's joints in this language.
        pulses_per_deg: of the controller's axes; none where it is not known.
        p_MC: origin of the controller's base frame in the model's, (3,) [m]; None: not known.
        frames: tool and base that the person has named, for files that do not say them.
        companion: text of the other half of the module (KRL: ``.src`` and ``.dat``), or nothing.
        declared_together: names, in small letters, of targets in the other files that are corrected along with it.
        refused: (line, sentence) of what makes the meaning of the whole file uncertain.
        left: (line, sentence) of moves and points that stay as they are.
        notes: (line, sentence) that the person should know.
    """

    name: str
    robot: Robot
    frames: ToolAndBase
    companion: str = ""
    declared_together: frozenset[str] = frozenset()
    axes: tuple[str, ...] = ()
    pulses_per_deg: tuple[float, ...] = ()
    p_MC: tuple[float, ...] | None = None
    refused: list[Note] = field(default_factory=list)
    left: list[Note] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    _found: list[Target | None] = field(default_factory=list)
    _said: set[tuple[int, Note]] = field(default_factory=set)  # what stands in the lists of lines

    def refuse(self, line: int, sentence: str) -> None:
        """Note that the file cannot be compensated because of ``line``, and why."""
        self._note_once(self.refused, (line, sentence))

    def leave(self, line: int, sentence: str) -> None:
        """Note that the target in ``line`` stays as it is, and why."""
        self._note_once(self.left, (line, sentence))

    def _note_once(self, list_: list[Note], note: Note) -> None:
        if (id(list_), note) not in self._said:
            self._said.add((id(list_), note))
            list_.append(note)

    def check(self) -> None:
        """Refuse the file if any of its targets was refused.

        Raises:
            InputError: one sentence a line.
        """
        if self.refused:
            raise InputError("\n".join(list_lines(self.name, self.refused)))

    def reserve(self) -> int:
        """Return the index of a target that is filled in later.

        Raises:
            InputError: the file has more targets than are kept at once.
        """
        most_targets = 50_000  # of a file; each takes some kilobytes until all are corrected
        if len(self._found) >= most_targets:
            raise InputError(
                f"{self.name}: has more than {most_targets} targets, which would take more memory than there may be; "
                "split the file, and correct its parts one after the other"
            )
        self._found.append(None)
        return len(self._found) - 1

    def add(self, target: Target, index: int | None = None) -> int:
        """Note a target, at the index that was reserved for it, and return the index."""
        index = self.reserve() if index is None else index
        if target.pose is not None and self.p_MC is not None:
            T_WB = np.array(target.pose.T_WB)
            T_WB[:3, 3] += self.p_MC
            target = replace(target, pose=replace(target.pose, T_WB=read_only(T_WB)))
        if target.is_sensible:
            self._found[index] = target
        else:
            self.leave(target.line, "a number of the target, its tool or its base is larger than any robot's")
        return index

    def add_joints(
        self, line: int, found: Sequence[PlacedNumber], index: int | None = None, tool: Array | str = ""
    ) -> int:
        """Note a joint target with its angles in degrees, and the tool of its moves where the file says one."""
        return self.add_angles(line, found, [DEG] * len(found), DEG_DECIMALS, index, tool)

    def add_angles(
        self,
        line: int,
        found: Sequence[PlacedNumber],
        units: Sequence[float],
        decimals: int,
        index: int | None = None,
        tool: Array | str = "",
    ) -> int:
        """Note a joint target with its angles in ``units`` [rad]; ``tool``: of its moves (4, 4) [m], or why not known.

        A tool without a length is none: programs of joint angles drive with the bare flange where nobody named a tool.
        """
        slots = tuple(number.slot(unit, decimals) for number, unit in zip(found, units, strict=True))
        q = read_only(np.array([number.value for number in found]) * np.array(units))
        p_FM = None if isinstance(tool, str) or not tool[:3, 3].any() else read_only(tool[:3, 3])
        unknown = _NOT_HELD.match(tool) if isinstance(tool, str) else None
        return self.add(Target(line, slots, q=q, p_FM=p_FM, unknown_tool=unknown[1] if unknown else ""), index)

    def take_targets(self) -> list[Target]:
        """Return the targets in order, without the places that stayed empty; what follows one of those is left."""
        followers: dict[int, list[int]] = {}
        for i, t in enumerate(self._found):
            for before in () if t is None else t.follows:
                followers.setdefault(before, []).append(i)
        lost = [i for i, t in enumerate(self._found) if t is None]
        for before in lost:  # grows by those that follow one
            for i in followers.get(before, ()):
                if self._found[i] is not None:
                    self.leave(self._line(i), FOLLOWS_NONE)
                    self._found[i] = None
                    lost.append(i)
        places = {i: k for k, i in enumerate(i for i, t in enumerate(self._found) if t is not None)}
        found = [t for t in self._found if t is not None]
        return [
            replace(
                t,
                follows=tuple(places[i] for i in t.follows),
                straight=tuple(places[i] for i in t.straight if i in places),
            )
            for t in found
        ]

    def _line(self, index: int) -> int:
        target = self._found[index]
        return 0 if target is None else target.line


def list_lines(name: str, lines: Iterable[Note]) -> Iterator[str]:
    """Yield ``name:line: sentence`` in the order of the file, the first of many and the count of the rest."""
    shown = 20  # refused lines that one message lists
    ordered = sorted(lines)
    yield from (f"{name}:{line}: {sentence}" for line, sentence in ordered[:shown])
    if len(ordered) > shown:
        yield f"{name}: and {len(ordered) - shown} more lines like these"


def line_ranges(numbers: Iterable[int]) -> str:
    """Return line numbers as ``3, 5-9``."""
    runs: list[list[int]] = []
    for n in sorted(set(numbers)):
        if runs and n == runs[-1][1] + 1:
            runs[-1][1] = n
        else:
            runs.append([n, n])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in runs)
