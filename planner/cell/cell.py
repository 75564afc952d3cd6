"""The cell in SI units, checked and read-only: robot, tool, gauge, fixtures, balls, and how it is driven."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from planner.cell.circles import Circle
from planner.cell.file import CellFile
from planner.cell.gauge import Gauge
from planner.common.choices import Aim
from planner.common.units import Array, read_only
from planner.kinematics.bar_geometry import bar_state
from planner.kinematics.bodies import Body
from planner.kinematics.chain import Chain, Transform
from planner.kinematics.robot import Robot


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
    R_BX: Array = field(default_factory=lambda: read_only(np.eye(3)))
    turn: float = np.inf
    point: int = 0


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
    tour_cost: Literal["limits", "axes"] = "limits"


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
class ControllerSettings:
    """What programs select and signal; see the cell file."""

    tool: int | None
    base: int | None
    load: int | None
    sync_output: int | None
    gauge_input: int | None
    log_axes: bool
    dialects: tuple[str, ...]


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
    aim: Aim = "index"


@dataclass(frozen=True)
class Cell:
    """Robot, tool, fixtures, gauge and surroundings; ``file`` is what was read, whole.

    ``carrier`` are the artifact's bodies, in its own frame; ``nests`` tie a tracker's frame to the artifact's.
    """

    name: str
    robot: Robot
    home: Array
    tool: Tool
    gauge: Gauge
    fixtures: tuple[Fixture, ...]
    balls: tuple[Ball, ...]
    obstacles: tuple[Body, ...]
    motion: MotionSettings
    cable: Cable
    base: BaseMounting
    controller: ControllerSettings
    plan: PlanSettings
    file: CellFile
    path: Path
    circles: tuple[Circle, ...] = ()
    carrier: tuple[Body, ...] = ()
    nests: tuple[Nest, ...] = ()

    @property
    def p_BS(self) -> Array:
        """Balls in the base frame, where the cell says that the artifact stands, (K, 3) [m]."""
        place = self.fixtures[0]
        return np.array([b.p_GS for b in self.balls]).reshape(-1, 3) @ place.R_BX.T + place.p_BX

    @property
    def joint_range(self) -> tuple[Array, Array]:
        """Range of each joint, both ends (N,) [rad]: its limits, or a turn about home where it can turn further.

        More turns only repeat the same arm.
        """
        turn, robot = 2 * np.pi, self.robot
        lower = np.clip(self.home - np.pi, robot.q_lower, np.maximum(robot.q_upper - turn, robot.q_lower))
        return lower, np.minimum(lower + turn, robot.q_upper)

    @property
    def sampling_range(self) -> tuple[Array, Array]:
        """Range that each joint is sampled in, both ends (N,) [rad]: narrowed to what the cable lets each axis do."""
        lower, upper = self.joint_range
        for axes, limit in self.cable.sums:
            for a in axes:
                lower[a] = max(lower[a], self.home[a] - limit)
                upper[a] = min(upper[a], self.home[a] + limit)
        return lower, upper

    @property
    def unwound(self) -> "Cell":
        """The cell without the cable's twist along the bar, which counts from a mount pose that is not yet chosen."""
        return replace(self, cable=replace(self.cable, tool_about_bar=None))

    def at(self, fixture: int) -> "Cell":
        """Return the cell with the tool point that the bar hangs from at the entry ``fixture`` of its fixtures."""
        if not self.tool.points:
            return self
        point = self.tool.points[self.fixtures[fixture].point]
        return replace(self, tool=replace(self.tool, p_FM=point.p_FM, axis_F=point.axis_F))

    def point_name(self, fixture: int) -> str:
        """Return the name of that tool point; empty where there is but one."""
        return self.tool.points[self.fixtures[fixture].point].name if self.tool.points else ""

    def place_name(self, fixture: int) -> str:
        """Return what a person calls that place of the bar: the fixture, and the tool point where there are several."""
        point = self.point_name(fixture)
        return self.fixtures[fixture].name + (f", tool point {point}" if point else "")

    def place_record(self, fixture: int) -> dict[str, object]:
        """Return the fixture and, where the tool has several points, the one that the bar hangs from."""
        point = self.point_name(fixture)
        place: dict[str, object] = {"fixture": self.fixtures[fixture].name}
        return place | {"point": point} if point else place

    @property
    def chain(self) -> Chain:
        """The chain from the base to the measurement application point."""
        tool = [Transform(f"map_{'xyz'[k]}", "translation", k, float(self.tool.p_FM[k])) for k in range(3)]
        return Chain((*self.robot.transforms, *tool))

    def map_position(self, q: Array) -> Array:
        """Position of the MAP in the base frame, (n, 3) [m], for controller angles q (n, N) [rad]."""
        return self.chain.carry(self.robot.theta(q), np.zeros(3))

    def bar_length(self, q: Array, fixture: int) -> Array:
        """Length of the bar at an entry of the fixtures, (n,) [m], for controller angles q (n, N) [rad]."""
        return bar_state(self.at(fixture).map_position(q), self.fixtures[fixture].p_BX).length

    def map_jacobian(self, q: Array) -> Array:
        """Derivative of the MAP position by the controller angles, (n, 3, N) [m/rad]."""
        chain = self.chain
        screws = chain.forward(self.robot.theta(q)).point_screws(chain.joint_places)  # (N, 3, n) by theta
        return np.asarray(np.einsum("jkn,ji->nki", screws, self.robot.sense_matrix))

    def map_axis(self, q: Array) -> Array:
        """Axis of the MAP's ball joint in the base frame, (n, 3)."""
        return self.chain.carry(self.robot.theta(q), self.tool.axis_F, point=False)
