"""The neutral program: what the robot shall do, before any controller's language.

Angles are those of the robot's model, in degrees, until :mod:`planner.programs.controller_axes` has turned the program
into the axes of the controller that runs it. From there on they are printed as they are.
"""

import math
import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from planner.cell.file import ControllerFile
from planner.common.errors import InputError
from planner.kinematics.axes import AxisConvention
from planner.runs.run import Mounting


@dataclass(frozen=True)
class JointMove:
    """Drive all axes together to ``q_deg``: straight in joint space, or with ``via_deg`` on a circle of the tool."""

    q_deg: tuple[float, ...]
    duration_s: float
    """Planned time of the leg [s]."""
    tool_speed_mm_s: float
    """Highest speed of the measured point on the leg [mm/s]."""
    axis_percent: float
    """Highest percentage of full axis speed at which ``tool_speed_mm_s`` still holds, in (0, 100]."""
    blend_mm: float = 0.0
    """Distance from the end at which the corner may be cut [mm]; 0 is an exact stop, in a dense path too:
    there every step but the last has a distance, or the robot halts at each of them."""
    pose: int | None = None
    """Identity of the measuring pose that the leg ends at, if it does."""
    tool_travel_mm: float | None = None
    """Largest |dx/ds| of the leg, s from 0 to 1 along it [mm]; unknown: speed times duration stands in."""
    tool_limit_mm_s: float = math.inf
    """What the tool's speed must not exceed on the leg [mm/s]."""
    mounting: Mounting | None = None
    """Where a gauge is attached on the leg, counted from 0; its own rate is limited as well."""
    shortest_s: float | None = None
    """Least time in which even motion of the joints keeps every limit of speed [s]; unknown: ``duration_s``."""
    via_deg: tuple[float, ...] | None = None
    """Angles at a middle point of a circle that the tool runs on without turning, in controllers that know circles."""

    @property
    def travel_mm(self) -> float:
        """Return the tool travel that blending distances are converted with [mm]."""
        return self.tool_speed_mm_s * self.duration_s if self.tool_travel_mm is None else self.tool_travel_mm


@dataclass(frozen=True)
class Dwell:
    """Stand still for ``seconds`` [s]."""

    seconds: float


@dataclass(frozen=True)
class Sync:
    """Pulse the output that marks pose ``pose`` in the gauge's log."""

    pose: int


@dataclass(frozen=True)
class LogAxes:
    """Let the controller itself record its axis angles at pose ``pose``; in passing where its language can."""

    pose: int


@dataclass(frozen=True)
class Centre:
    """Call the routine that brings the tool point onto a ball; the robot then stands where that led it.

    ``ball`` counts from 1 as the cell lists them.
    """

    ball: int
    pose: int


@dataclass(frozen=True)
class Pause:
    """Stop until the operator has done what ``message`` says and starts again.

    Where a person leads the robot meanwhile, ``led_to_deg`` are the angles there, and ``ball`` the one that is touched.
    """

    message: str
    led_to_deg: tuple[float, ...] | None = None
    ball: int | None = None


@dataclass(frozen=True)
class WaitInput:
    """Wait until the input is on that tells ``what``, such as "gauge ready"."""

    what: str


@dataclass(frozen=True)
class Comment:
    """A remark for the reader."""

    text: str


@dataclass(frozen=True)
class Section:
    """The heading of a stretch of the program."""

    name: str


@dataclass(frozen=True)
class StretchBegin:
    """What follows, up to the end of the stretch, is left out where the operator starts behind ``until``."""

    until: int


@dataclass(frozen=True)
class StretchEnd:
    """The end of a stretch; stretches do not lie in one another."""


@dataclass(frozen=True)
class Entry:
    """The way into the middle of a session, driven only where the operator starts at ``at``; exact stops throughout."""

    at: int
    origin_deg: tuple[float, ...]
    """Where the robot stands before it."""
    moves: tuple[JointMove, ...]


Instruction = (
    JointMove | Dwell | Sync | LogAxes | Centre | Pause | WaitInput | Comment | Section
    | StretchBegin | StretchEnd | Entry
)  # fmt: skip


StopKind = Literal["pause", "wait"]
"""What lets a program go on that has stopped: a person, or an input."""


@dataclass(frozen=True)
class Program:
    """A whole measuring session, checked for sense when it is made.

    Where ``controller`` names no ``sync_output`` no output is switched, and without ``gauge_input`` no input is waited
    on, whatever the instructions mark. ``map_mm`` and ``com_mm`` are in the flange frame: the measured point, and the
    centre of mass of what is bolted on.

    Raises:
        InputError: an angle, time, speed or blend that no controller could drive, or a stop asked for
            where the path is blended.
    """

    plan_id: str
    robot: str
    n_joints: int
    home_deg: tuple[float, ...]
    instructions: tuple[Instruction, ...]
    controller: ControllerFile
    """Numbers to select, signals to use, and what takes the place of the dialect's own limits."""
    map_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_kg: float = 0.0
    com_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    joint_names: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()
    """Unit of each axis, ``deg`` or ``mm``, where one slides: what is called degrees is millimetres of that."""
    acceleration_deg_s2: tuple[float, ...] = ()
    """Limit of each joint, for whom a program must say its ramps [deg/s²]; none where it is not known."""
    pulses_per_deg: tuple[float, ...] = ()
    """Of each axis of the controller, for languages that count in pulses; none where it is not known."""
    axes: AxisConvention | None = None
    """How the controller counts whose axes the angles are; ``None`` while they are the model's."""
    changed: str = ""
    """What is said at the head of a program whose plan is not as it was planned, though it bears that plan's id."""
    cautions: tuple[str, ...] = ()
    """What the plan has to say at the head of a program of any language."""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[0-9a-f]{12}", self.plan_id):
            raise InputError(f"plan_id '{self.plan_id}' is not 12 hex digits")
        _check_angles(self.home_deg, self.n_joints, "home")
        if not all(math.isfinite(v) for v in (*self.map_mm, *self.com_mm, self.mass_kg)) or self.mass_kg < 0.0:
            raise InputError(f"the tool has a place or a mass ({self.mass_kg} kg) that is no sensible number")
        if self.acceleration_deg_s2 and (
            len(self.acceleration_deg_s2) != self.n_joints or not min(self.acceleration_deg_s2) > 0.0
        ):
            raise InputError(f"acceleration_deg_s2 is no limit above 0 for each of {self.n_joints} joints")
        if not self.moves:
            raise InputError("the program holds no move")
        for number, move in enumerate(self.moves, start=1):
            _check_move(move, self.n_joints, f"move {number}")
        if self.moves[0].blend_mm or self.moves[-1].blend_mm:
            raise InputError("the first and the last move of a program are exact stops, blend_mm must be 0")
        for entry in self.entries:
            for number, move in enumerate(entry.moves, start=1):
                _check_move(move, self.n_joints, f"move {number} of the path to start {entry.at}")
        _check_stops(self.instructions)

    @cached_property
    def moves(self) -> tuple[JointMove, ...]:
        """Return the moves alone, in order, without those of the entries."""
        return tuple(i for i in self.instructions if isinstance(i, JointMove))

    @cached_property
    def stops(self) -> tuple[tuple[StopKind, int], ...]:
        """Return where the program waits for a person or an input, in order: which, and after how many moves.

        Where the cell names no input a person stands for it, at the pause right before or at one of its own.
        """
        out: list[tuple[StopKind, int]] = []
        moves, paused = 0, False
        for item in self.instructions:
            moves += isinstance(item, JointMove)
            by_input = isinstance(item, WaitInput) and self.controller.gauge_input is not None
            pauses = isinstance(item, Pause) or (isinstance(item, WaitInput) and not by_input and not paused)
            out += [("wait", moves)] if by_input else [("pause", moves)] if pauses else []
            paused = pauses
        return tuple(out)

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Return the ways into the session, in order."""
        return tuple(i for i in self.instructions if isinstance(i, Entry))

    @property
    def has_circles(self) -> bool:
        """Return whether a move is a circle of the tool."""
        return any(m.via_deg is not None for m in self.moves)

    @property
    def stretches(self) -> tuple[tuple[int, int], ...]:
        """Return ``until`` of every stretch and how many moves come before it."""
        out, moves = [], 0
        for item in self.instructions:
            moves += isinstance(item, JointMove)
            if isinstance(item, StretchBegin):
                out.append((item.until, moves))
        return tuple(out)

    def slides(self, axis: int) -> bool:
        """Tell whether an axis, from 0, slides."""
        return bool(self.joint_units) and self.joint_units[axis] == "mm"

    def unit_of(self, axis: int) -> str:
        """Return the unit of an axis, from 0: ``deg``, or ``mm`` of one that slides."""
        return "mm" if self.slides(axis) else "deg"

    def without_starts(self) -> "Program":
        """Return the program for a controller that can be started at its beginning only."""
        kept = (i for i in self.instructions if not isinstance(i, StretchBegin | StretchEnd | Entry))
        return replace(self, instructions=tuple(kept))


def _check_angles(q_deg: tuple[float, ...], n_joints: int, where: str) -> None:
    if len(q_deg) != n_joints:
        raise InputError(f"{where} has {len(q_deg)} angles, the robot has {n_joints} joints")
    if not all(math.isfinite(q) and abs(q) < 1e5 for q in q_deg):
        raise InputError(f"{where} has an angle that is no finite number of degrees: {q_deg}")


def _check_move(move: JointMove, n_joints: int, where: str) -> None:
    _check_angles(move.q_deg, n_joints, where)
    if move.via_deg is not None:
        _check_angles(move.via_deg, n_joints, f"the middle of the circle of {where}")
    allowed = {
        "duration_s": (move.duration_s, 0.0 < move.duration_s < 1e5),
        "tool_speed_mm_s": (move.tool_speed_mm_s, 0.0 <= move.tool_speed_mm_s < 1e5),
        "axis_percent": (move.axis_percent, 0.0 < move.axis_percent <= 100.0),
        "blend_mm": (move.blend_mm, 0.0 <= move.blend_mm < 1e4),
    }
    for name, (value, good) in allowed.items():
        if not good:
            raise InputError(f"{where}: {name} = {value} is out of range")


def _check_stops(instructions: tuple[Instruction, ...]) -> None:
    blended = False
    for item in instructions:
        if isinstance(item, JointMove):
            blended = item.blend_mm > 0.0
        elif isinstance(item, Dwell | Centre | Pause | WaitInput) and blended:
            raise InputError(f"only a move that ends in an exact stop can be followed by {item}")
        elif isinstance(item, Dwell) and not 0.0 < item.seconds < 1e5:
            raise InputError(f"a dwell of {item.seconds} s is out of range")
