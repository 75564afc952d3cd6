"""The parts of a cell in SI units: tool, balls, nests, fixtures, indicators, how it is driven, how the base stands."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from planner.common.choices import Aim, SelectionMethod, SetUp, TourOrder
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body

STANDARD_GRAVITY = 9.80665  # [m/s²]


@dataclass(frozen=True)
class ToolPoint:
    """One of several MAPs on a tool: p_FM (3,) [m], axis of its ball joint (3,)."""

    name: str
    p_FM: Array
    axis_F: Array


@dataclass(frozen=True)
class Tool:
    """Tool on the flange F: its measurement application points (MAP), mass [kg], com_F (3,) [m], bodies.

    Where ``known`` is false the cell gives no MAP and it stands at the flange; ``measured`` says that the MAP was
    measured on the tool, so that ``prior`` is the uncertainty of that. ``points`` are all its MAPs; ``point`` is the
    one that the gauge is held at, see :meth:`Cell.at`; ``work`` (3,) [m] is the point that the robot works with.
    """

    points: tuple[ToolPoint, ...]
    mass: float
    com_F: Array
    bodies: tuple[Body, ...]
    prior: float
    known: bool = True
    measured: bool = False
    point: int = 0
    work: Array | None = None

    @property
    def p_FM(self) -> Array:
        """The MAP that the gauge is held at, (3,) [m]."""
        return self.points[self.point].p_FM

    @property
    def axis_F(self) -> Array:
        """The axis of its ball joint, (3,)."""
        return self.points[self.point].axis_F


@dataclass(frozen=True)
class Ball:
    """One ball or socket of an artifact: p_GS (3,) [m] in the plate's own frame, radius [m].

    ``stem`` (3,) [m] is where its stem is held, in the same frame, with the stem's radius [m] beside it; ``axis_G``
    (3,) is the way out of a socket.
    """

    name: str
    p_GS: Array
    radius: float = 0.0
    stem: Array | None = None
    stem_radius: float = 0.0
    axis_G: Array = field(default_factory=lambda: read_only([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Nest:
    """A nest for the tracker's reflector: p_WN (3,) [m] in the artifact's frame, and as the tracker read it."""

    name: str
    p_WN: Array
    p_GN: Array | None


@dataclass(frozen=True)
class Fixture:
    """Magnet cup in the base frame B: p_BX (3,) [m], axis of its ball joint (3,), prior sigma of its error [m].

    ``mounts`` (N,) [rad], one for each of the tool's points, are the poses where the bar is attached, ``None`` until
    one is chosen. The artifact of a head with indicators and the station of a tracker stand here too: ``R_BX`` (3, 3)
    is how they are turned, ``turn`` the prior sigma of the error of that [rad], and their mount is where the head is
    mastered or the reflector put in. ``set_up`` tells whether the robot's own tool point was driven there to place it.
    """

    name: str
    p_BX: Array
    axis_B: Array
    prior: float
    mounts: tuple[Array | None, ...] = (None,)
    R_BX: Array = field(default_factory=lambda: read_only(np.eye(3)))
    turn: float = np.inf
    set_up: SetUp = "measured"

    @property
    def room(self) -> float:
        """How far from its place it may stand [m]: two standard deviations, for which a plan keeps room."""
        return 2 * self.prior


@dataclass(frozen=True)
class IndicatorHead:
    """Three indicators that meet at right angles in the MAP (TriCal paper, 2.1).

    Attributes:
        axes_F: from the MAP to each indicator, in the flange frame, (3, 3), one a row.
        range: of each indicator [m].
        usable: largest distance of a ball from the centre at which all three tips make contact [m].
        tip: diameter of the disk tips [m].
        approach: stand-off from the ball, along the tool's axis [m].
        master: diameter of the master ball [m].
        uncalibrated: position error that the robot keeps before calibration, at 95 % of its poses or more [m].
        seconds: one centring takes [s].
    """

    axes_F: Array
    range: float
    usable: float
    tip: float
    approach: float
    master: float
    uncalibrated: float
    seconds: float


@dataclass(frozen=True)
class MotionSettings:
    """How poses are joined: speeds [m/s], blend and clearance [m], times [s]; travel as a part of full speed."""

    measure: Literal["continuous", "static"]
    both_ways: bool
    tool_speed: float
    blend: float
    clearance: float
    dwell: float
    settle: float
    travel: float
    order: TourOrder = "slowest-limit"

    @property
    def is_continuous(self) -> bool:
        """Whether the gauge is read while moving."""
        return self.measure == "continuous"


@dataclass(frozen=True)
class Cable:
    """Budget of twist: sums of |q − home| over axes (indices from 0) [rad], and of the tool about the bar [rad]."""

    sums: tuple[tuple[tuple[int, ...], float], ...]
    tool_about_bar: float | None


@dataclass(frozen=True)
class BaseMounting:
    """How the base stands: R_WB (3, 3) from base to world (gravity along −z), floor height [m] or ``None``."""

    R_WB: Array
    floor: float | None


@dataclass(frozen=True)
class PlanSettings:
    """What the plan frees and how much it tries."""

    free: frozenset[str]
    poses: int | None
    candidates: int
    grid_step: float | None
    index: str
    refine: bool
    repeat: int
    validate: int
    effects: tuple[str, ...] = ()
    aim: Aim | None = None
    method: SelectionMethod | None = None


class NamedPlace(Protocol):
    """What a file says of a place of the gauge: its names, the point's empty where the tool has but one."""

    fixture: str
    point: str
