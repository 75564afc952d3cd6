"""What a planned circular test is made of."""

from dataclasses import dataclass

import numpy as np

from planner.cell import Cell, Circle
from planner.cell.circles import Direction
from planner.path import Verdict
from planner.plan import Waypoints
from planner.program import ProgramFile
from planner.trajectory import LimitReport, Trajectory
from planner.units import Array

SPEED_SAMPLES = 2000


@dataclass(frozen=True)
class Arc:
    """A circle with overshoot as the arm drives it, in the sense in which angles grow.

    Attributes:
        circle: which.
        angle: of the points (m,) [rad].
        q: controller angles there, (m, N) [rad].
        length: of the bar there, (m,) [m].
        off: largest distance of the trajectory from the circle [m].
        blend: distance from each point at which its corner may be cut [m].
        trajectory: timed from rest to rest; back: driven the other way.
        verdicts: of both collision engines; limits: the trajectory held against the axes' limits.
        told: how the way round was chosen. A plan read back has none of these three.
    """

    circle: Circle
    angle: Array
    q: Array
    length: Array
    off: float
    blend: float
    trajectory: Trajectory
    back: Trajectory
    verdicts: tuple[Verdict, ...] = ()
    limits: LimitReport | None = None
    told: str = ""

    def waypoints(self) -> Waypoints:
        """Return the points with marks (0 and 1) at both ends of the sweep and the radius of every blend."""
        radius = np.full(len(self.q), self.blend)
        radius[[0, -1]] = 0.0
        marks = np.full(len(self.q), -1)
        marks[np.flatnonzero(self.sweep)[[0, -1]]] = (0, 1)
        return Waypoints(self.q, marks, radius)

    @property
    def slowest_on_sweep(self) -> float:
        """Smallest speed of the tool point on the sweep, going and coming [m/s]."""
        marks = np.flatnonzero(self.sweep)[[0, -1]]
        ways = ((self.trajectory, marks), (self.back, len(self.q) - 1 - marks[::-1]))
        share = np.linspace(0.0, 1.0, SPEED_SAMPLES)
        slowest = []
        for trajectory, (first, last) in ways:
            begin, end = trajectory.waypoint_time[first], trajectory.waypoint_time[last]
            slowest.append(float(trajectory.at(begin + share * (end - begin)).tool_speed.min()))
        return min(slowest)

    @property
    def sweep(self) -> np.ndarray:
        """Which points lie on the sweep that is measured, (m,) bool."""
        past = self.angle - self.circle.start
        return np.asarray((past > -1e-9) & (past < self.circle.sweep + 1e-9))


@dataclass(frozen=True)
class Pass:
    """One stretch of the session with the bar on, from rest to rest.

    Attributes:
        arc: which of the session's arcs it measures, ``None`` on the way from one to the next.
        direction: in which, "" on the way.
        load: force along the bar [N], ``None`` without.
        repeat: counts from 0.
        points: the path, with the ids of the marks at both ends of the sweep.
        trajectory: the path in time.
    """

    arc: int | None
    direction: Direction | str
    load: float | None
    repeat: int
    points: Waypoints
    trajectory: Trajectory

    @classmethod
    def between(cls, points: Waypoints, trajectory: Trajectory) -> "Pass":
        """Return the way from one circle to the next."""
        return cls(None, "", None, 0, points, trajectory)

    @property
    def marks(self) -> tuple[int, ...]:
        """Ids of the marks on the way."""
        return tuple(int(v) for v in self.points.visit if v >= 0)


@dataclass(frozen=True)
class CircularDrive:
    """All circles about one fixture.

    Attributes:
        fixture: which.
        arcs: its circles.
        way: from home to the mount pose, without the bar; way_trajectory: in time. It is driven back at the end.
        passes: with the bar on, from the mount pose back to it, in order.
        verdicts: of both engines on the travel and on the ways between circles.
    """

    fixture: int
    arcs: tuple[Arc, ...]
    way: Waypoints
    way_trajectory: Trajectory
    passes: tuple[Pass, ...]
    verdicts: tuple[Verdict, ...] = ()

    @property
    def duration(self) -> float:
        """Time with the bar on [s]."""
        return sum(p.trajectory.duration_s for p in self.passes)


@dataclass(frozen=True)
class CircularPlan:
    """A planned circular test: the cell with its mount poses, what is driven, and the programs."""

    plan_id: str
    cell: Cell
    seed: int
    drives: tuple[CircularDrive, ...]
    programs: tuple[tuple[str, tuple[ProgramFile, ...]], ...] = ()
    notes: tuple[str, ...] = ()
