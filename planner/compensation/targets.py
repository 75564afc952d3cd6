"""What a file asks the robot to do, whatever its language: joint targets and poses, and where their numbers stand."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.units import Array
from planner.kinematics.robot import Robot
from planner.programs.languages.text import Refusals, Slot

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


@dataclass
class TargetReading:
    """What a reader of a language works with, and what it notes.

    Attributes:
        robot: the nominal robot.
        axes: names of the robot's joints in this language.
        frames: tool and base that the person has named, for files that do not say them.
        refusals: lines that are not understood.
        targets: found so far.
        notes: (line, sentence) that the person should know.
    """

    robot: Robot
    axes: tuple[str, ...]
    frames: "ToolAndBase"
    refusals: Refusals
    targets: list[Target]
    notes: list[tuple[int, str]]


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
