"""What a cell is made of: tool, gauge, fixtures, balls, nests, and how it is driven; SI units, read-only."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from planner.bodies import Body
from planner.cell.file import Aim
from planner.units import Array, frozen

LENGTH_GAUGES = ("edbb", "ldbb", "draw-wire")


@dataclass(frozen=True)
class ToolPoint:
    """One of several MAPs on a tool: p_FM (3,) [m], axis of its ball joint (3,)."""

    name: str
    p_FM: Array
    axis_F: Array


@dataclass(frozen=True)
class Tool:
    """Tool on the flange F: MAP p_FM (3,) [m], axis of its ball joint (3,), mass [kg], com_F (3,) [m], bodies.

    Where ``known`` is false the cell gives no MAP and it stands at the flange; ``measured`` says that the MAP was
    measured on the tool, so that ``prior`` is the uncertainty of that. ``points`` are all its MAPs where it has
    several; p_FM is then the one that the bar hangs from, see :meth:`Cell.at`.
    """

    p_FM: Array
    axis_F: Array
    mass: float
    com_F: Array
    bodies: tuple[Body, ...]
    prior: float
    known: bool = True
    measured: bool = False
    points: tuple[ToolPoint, ...] = ()


@dataclass(frozen=True)
class Ball:
    """One ball or socket of an artifact: p_GS (3,) [m] in the plate's own frame, radius [m].

    ``stem`` (3,) [m] is where its stem is held, in the same frame, with the stem's radius [m] beside it.
    """

    name: str
    p_GS: Array
    radius: float = 0.0
    stem: Array | None = None
    stem_radius: float = 0.0


@dataclass(frozen=True)
class Nest:
    """A nest for the tracker's reflector: p_WN (3,) [m] in the artifact's frame, and as the tracker read it."""

    name: str
    p_WN: Array
    p_GN: Array | None


@dataclass(frozen=True)
class Fixture:
    """Magnet cup in the base frame B: p_BX (3,) [m], axis of its ball joint (3,), prior size of its error [m].

    ``point`` is which of the tool's points the bar hangs from: a cup stands here once for each of them.

    ``mount`` (N,) [rad] is the pose where the bar is attached, ``None`` until one is chosen. The artifact of a head
    with indicators and the station of a tracker stand here too: ``R_BX`` (3, 3) is how they are turned, ``turn`` the
    prior size of the error of that [rad], and their mount is where the head is mastered or the reflector put in.
    """

    name: str
    p_BX: Array
    axis_B: Array
    prior: float
    mount: Array | None = None
    R_BX: Array = field(default_factory=lambda: frozen(np.eye(3)))
    turn: float = np.inf
    point: int = 0


@dataclass(frozen=True)
class Head:
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
class Gauge:
    """A gauge: noise [m], and of a probe's orientation [rad]; of a bar range [m], cones [rad] and body [m]."""

    kind: str
    length_min: float
    length_max: float
    noise: float
    cone_fixture: float
    cone_map: float
    zero_free: bool
    radius: float
    housing: float
    rod_radius: float
    trim: float
    noise_angle: float = 1e-4
    head: Head | None = None

    @property
    def is_bar(self) -> bool:
        """Whether it is held between fixture and tool, and reads a length."""
        return self.kind in LENGTH_GAUGES


@dataclass(frozen=True)
class Motion:
    """How poses are joined: speeds [m/s], blend and clearance [m], times [s]; travel as a part of full speed."""

    measure: Literal["continuous", "static"]
    both_ways: bool
    tool_speed: float
    blend: float
    clearance: float
    dwell: float
    settle: float
    travel: float


@dataclass(frozen=True)
class Cable:
    """Budget of twist: sums of |q − home| over axes (indices from 0) [rad], and of the tool about the bar [rad]."""

    sums: tuple[tuple[tuple[int, ...], float], ...]
    tool_about_bar: float | None


@dataclass(frozen=True)
class Base:
    """How the base stands: R_WB (3, 3) from base to world (gravity along −z), floor height [m] or ``None``."""

    R_WB: Array
    floor: float | None


@dataclass(frozen=True)
class Controller:
    """What programs select and signal; see the cell file."""

    tool: int | None
    base: int | None
    load: int | None
    sync_output: int | None
    gauge_input: int | None
    log_axes: bool
    dialects: tuple[str, ...]


@dataclass(frozen=True)
class PlanOptions:
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
    aim: Aim = "index"
