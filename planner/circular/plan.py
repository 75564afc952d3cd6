"""A planned circular test: its circles as the arm drives them, and the passes through them.

Circles and half circles of a cell for a circular test, in the manner of ISO 230-4.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.cell.cell import Cell
from planner.cell.section_content import SectionContent
from planner.common.units import Array, read_only, to_mm
from planner.kinematics.geometry import bar_state
from planner.motion.path.verdict import Verdict
from planner.motion.timing.trajectory import Trajectory
from planner.runs.run import Mounting, Samples
from planner.session.plan_types import Course, Pass, SessionDrive, SessionPlan, TimedPath, Waypoints, time_path

CirclePlane = Literal["XY", "XZ", "YZ"]
CircleDirection = Literal["ccw", "cw"]
CIRCLES = "circles"  # the table of a cell file
NEAR_CIRCLE = 0.05  # of the radius: as far off the circle a sample may lie to count as on it


@dataclass(frozen=True)
class Circle:
    """A circle about p_BC in a plane of the base frame.

    Angles count from the plane's first axis towards its second; "ccw" is the way they grow.

    Attributes:
        name: short name; plane: its two axes; fixture: which fixture holds the bar.
        p_BC: centre (3,) [m]; radius [m].
        start, sweep: of what is measured; overshoot: driven before and after it [rad].
        directions: in which it is driven, in that order, ``repeats`` times for each load.
        speed: of the tool point [m/s].
        follows: whether the tool turns with the bar; else it keeps its orientation.
        axis_B: direction of the tool's ball-joint axis at the start (3,), ``None`` to have one chosen.
        loads: forces along the bar [N], empty for an unloaded bar.
    """

    name: str
    plane: CirclePlane
    fixture: int
    p_BC: Array
    radius: float
    start: float
    sweep: float
    overshoot: float
    directions: tuple[CircleDirection, ...]
    speed: float
    follows: bool
    axis_B: Array | None
    loads: tuple[float, ...]
    repeats: int

    @property
    def mounting(self) -> Mounting:
        """The bar is held at the circle's fixture and the tool's first point."""
        return Mounting(self.fixture)

    @property
    def axes(self) -> tuple[Array, Array]:
        """The plane's first and second axis in the base frame, (3,) each."""
        first, second = ("XYZ".index(a) for a in self.plane)
        return np.eye(3)[first], np.eye(3)[second]

    @property
    def normal(self) -> Array:
        """The axis about which angles grow, (3,)."""
        return np.cross(*self.axes)

    def points(self, angle: Array) -> Array:
        """Points p_BM (n, 3) [m] at angles (n,) [rad]."""
        first, second = self.axes
        return np.asarray(self.p_BC + self.radius * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second))


@dataclass(frozen=True)
class Circles(SectionContent):
    """``[[circles]]`` of a cell, as read."""

    circles: tuple[Circle, ...]
    replaces_poses = True

    @property
    def pulls(self) -> dict[int, str]:
        """The fixtures of circles that are driven under load."""
        return {c.fixture: f"{CIRCLES}.loads_N" for c in self.circles if c.loads}


def circles_of(cell: Cell) -> tuple[Circle, ...]:
    """Return the circles of a cell, in the order of its file."""
    content = cell.sections.get(CIRCLES)
    return content.circles if isinstance(content, Circles) else ()


def replace_circles(cell: Cell, *circles: Circle) -> Cell:
    """Return a cell with other circles, or with none."""
    others = {key: content for key, content in cell.sections.items() if key != CIRCLES}
    return replace(cell, sections=others | ({CIRCLES: Circles(circles)} if circles else {}))


@dataclass(frozen=True)
class CircleAtFixture:
    """A circle, in the base frame, and the ball at the fixed end of the bar.

    Attributes:
        centre: (3,) [m].
        axes: rows are the directions of angle 0 and 90 degrees and the normal, (3, 3).
        radius: [m].
        p_BX: the fixture's ball (3,) [m].
    """

    centre: Array
    axes: Array
    radius: float
    p_BX: Array

    @property
    def height(self) -> float:
        """Height of the circle above the fixture, along its normal [m]."""
        return float((self.centre - self.p_BX) @ self.axes[2])

    def to_polar(self, x: Array) -> tuple[Array, Array]:
        """Angle (n,) [rad] of points x (n, 3) [m], and how far they lie off the circle, (n,) [m]."""
        u, v, height = self.axes @ (x - self.centre).T
        return np.arctan2(v, u), np.asarray(np.hypot(np.hypot(u, v) - self.radius, height))

    def in_plane(self, angle: Array, length: Array) -> Array:
        """Points (n, 2) [m] from the centre, where a bar of this length (n,) [m] ends at angles (n,) [rad]."""
        unit = np.column_stack([np.cos(angle), np.sin(angle)])
        foot = self.axes[:2] @ (self.p_BX - self.centre)
        away = self.radius * unit - foot
        reach = np.sqrt(np.maximum(length**2 - self.height**2, 0.0))
        return np.asarray(foot + away * (reach / np.linalg.norm(away, axis=1))[:, None])


@dataclass(frozen=True)
class Arc:
    """A circle with overshoot as the arm drives it.

    Attributes:
        circle: which.
        angle: of the points (m,) [rad], ascending.
        ccw, cw: in the sense in which angles grow and in the other, from rest to rest, with marks 0 and 1 at both ends
            of the sweep.
        length: of the bar at the points, (m,) [m].
        off: largest distance of the trajectory from the circle [m].
        verdicts: of both collision engines.
        told: how the way round was chosen. A plan read back has neither.
    """

    circle: Circle
    angle: Array
    ccw: TimedPath
    cw: TimedPath
    length: Array
    off: float
    verdicts: tuple[Verdict, ...] = ()
    told: str = ""

    @property
    def q(self) -> Array:
        """Controller angles at the points, (m, N) [rad]."""
        return self.ccw.q

    @property
    def blend(self) -> float:
        """Distance from each point at which its corner may be cut [m]."""
        return float(self.ccw.blend.max())

    @property
    def slowest_on_sweep(self) -> float:
        """Smallest speed of the tool point on the sweep, going and coming [m/s]."""
        share, slowest = np.linspace(0.0, 1.0, 2000), []  # samples of the sweep
        for path in (self.ccw, self.cw):
            begin, end = path.trajectory.waypoint_time[np.flatnonzero(path.visit >= 0)]
            slowest.append(float(path.trajectory.at(begin + share * (end - begin)).tool_speed.min()))
        return min(slowest)


def points_on_sweep(circle: Circle, angle: Array) -> np.ndarray:
    """Tell which angles (m,) [rad] lie on the sweep that is measured, (m,) bool."""
    past = angle - circle.start
    return np.asarray((past > -1e-9) & (past < circle.sweep + 1e-9))


def drive_arc(cell: Cell, circle: Circle, angle: Array, q: Array, blend: float) -> Arc:
    """Time a circle both ways round through its points, their corners cut by up to ``blend`` [m]."""
    radius, marks = np.full(len(q), blend), np.full(len(q), -1)
    radius[[0, -1]] = 0.0
    marks[np.flatnonzero(points_on_sweep(circle, angle))[[0, -1]]] = (0, 1)
    there = Waypoints(q, marks, radius)
    back = replace(there.reverse(), visit=np.where(marks >= 0, 1 - marks, -1)[::-1])
    at_speed = replace(cell, motion=replace(cell.motion, tool_speed=circle.speed))
    ccw, cw = (time_path(at_speed, points, circle.mounting, bar=True) for points in (there, back))
    length = bar_state(cell.map_position(q), cell.fixtures[circle.fixture].p_BX).length
    return Arc(circle, read_only(angle), ccw, cw, read_only(length), circle_deviation(cell, circle, ccw.trajectory))


def circle_deviation(cell: Cell, circle: Circle, trajectory: Trajectory) -> float:
    """Largest distance of a trajectory from its circle [m], seen several times between any two of its points."""
    t = trajectory.waypoint_time
    between = t[:-1, None] + np.diff(t)[:, None] * np.linspace(0.0, 1.0, 5)
    out = cell.map_position(trajectory.angles(between.ravel())) - circle.p_BC
    across = out @ circle.normal
    radial = np.linalg.norm(out - across[:, None] * circle.normal, axis=1) - circle.radius
    return float(np.hypot(across, radial).max())


@dataclass(frozen=True)
class CircularPass(Pass):
    """One stretch with the bar on.

    Attributes:
        arc: which of the drive's arcs it measures, ``None`` on the way from one to the next.
        direction: in which, "" on the way.
        repeat: counts from 0.
    """

    arc: int | None = None
    direction: CircleDirection | str = ""
    repeat: int = 0

    @classmethod
    def from_path(cls, path: TimedPath, last: bool) -> "CircularPass":
        """Return the way from one circle to the next, or the last one."""
        return cls(path, "back to where the bar is taken off" if last else "to the next circle")


@dataclass(frozen=True, kw_only=True)
class CircularDrive(SessionDrive):
    """All circles about one fixture; the verdicts are those on the travel and on the ways between circles."""

    arcs: tuple[Arc, ...]

    @property
    def passes(self) -> tuple[CircularPass, ...]:
        """What is driven with the bar on, from the mount pose back to it."""
        return tuple(p for p in self.course.passes if isinstance(p, CircularPass))


@dataclass(frozen=True, kw_only=True)
class CircularPlan(SessionPlan):
    """The plan of a circular test."""

    drives: tuple[CircularDrive, ...]

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """All circles as they are driven."""
        return tuple(a for d in self.drives for a in d.arcs)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts of both collision engines, fixture by fixture: first on the circles, then on the ways."""
        return tuple(v for d in self.drives for part in (*(a.verdicts for a in d.arcs), d.verdicts) for v in part)


def measured_passes(arcs: Sequence[Arc], number: int) -> Iterator[CircularPass]:
    """Every pass that is measured, in order, with marks at both ends of its sweep, counted from ``number``."""
    for k, arc in enumerate(arcs):
        c = arc.circle
        circle = f"circle {c.name} in {c.plane}, radius {to_mm(c.radius):g} mm"
        for load in c.loads or (None,):
            loaded = "" if load is None else f", {load:g} N"
            for repeat in range(c.repeats):
                again = "" if c.repeats == 1 else f", repeat {repeat + 1} of {c.repeats}"
                for direction in c.directions:
                    path = arc.ccw if direction == "ccw" else arc.cw
                    timed = replace(path, visit=np.where(path.visit >= 0, path.visit + number, -1))
                    yield CircularPass(timed, f"{circle}, {direction}{loaded}{again}", load, k, direction, repeat)
                    number += 2


def circular_course(cell: Cell, mounting: Mounting, travel: TimedPath, passes: Sequence[CircularPass]) -> Course:
    """Return the course through the circles about one fixture."""
    name = cell.fixtures[mounting.fixture].name
    return Course(mounting, f"the first circle about fixture {name}", travel, tuple(passes))


def circle_samples(plan: CircularPlan, rate: float, ways: bool = True) -> Samples:
    """Where the arm is told to stand while the passes are driven, ``rate`` times a second; on the circles, or all."""
    parts, start = [], 0.0
    for drive in plan.drives:
        for one in (p for p in drive.passes if ways or p.arc is not None):
            motion = one.trajectory.sample(1.0 / rate)
            load = np.full(len(motion.t), 0.0 if one.load is None else one.load)
            place = np.full(len(motion.t), drive.mounting.fixture)
            parts.append((motion.t + start, motion.q, motion.dq, load, place))
            start += one.trajectory.duration_s + 5.0  # [s] between two passes
    t, q, speed, load, place = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Samples(
        q=read_only(q),
        place=place,
        t=read_only(t),
        session=np.zeros(len(t), dtype=int),
        force=read_only(load) if load.any() else None,
        speed=read_only(speed),
    )
