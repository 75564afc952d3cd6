"""What a plan is made of, stage by stage: the values that flow from the candidates to the program.

What the robot drives for one fixture, in time: the way to where it starts, and what is measured, with all blends.

A course is made from waypoints and blend radii alone, so a program exported later from ``plan.json`` is the same.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.design.bayesian_design import BayesianDesign
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.power import Discrimination
from planner.design.expected_errors import ErrorForecast
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_search import IndexCurve
from planner.design.target_errors import TargetForecast
from planner.kinematics.geometry import bar_state
from planner.motion.path.verdict import ProvenPath, Verdict
from planner.motion.timing.curve import ReadingLimits
from planner.motion.timing.leg_times import axis_limits
from planner.motion.timing.trajectory import LimitReport, Trajectory, plan_trajectory
from planner.motion.tour.solve import Tour
from planner.programs.rendering import ProgramFile
from planner.runs.run import Mounting

Role = Literal["calibrate", "repeat", "validate", "mount"]
"""What a pose is for."""


@dataclass(frozen=True)
class Waypoints:
    """A path to be driven: q (m, N) [rad], id of the pose or −1 (m,), blend radius (m,) [m], 0 where it rests."""

    q: Array
    visit: np.ndarray
    blend: Array

    def reverse(self) -> "Waypoints":
        """Return the path driven from its end to its beginning."""
        return Waypoints(self.q[::-1], self.visit[::-1], self.blend[::-1])

    def append_way_back(self) -> "Waypoints":
        """Return the path driven forward and then backward."""
        parts = ((a, a[-2::-1]) for a in (self.q, self.visit, self.blend))
        return Waypoints(*(np.concatenate(p) for p in parts))

    @property
    def one_way(self) -> int:
        """Number of points up to where a path that is driven there and back turns, or of all."""
        m = (len(self.q) + 1) // 2
        returns = len(self.q) % 2 == 1 and len(self.q) > 2 and np.array_equal(self.q[:m], self.q[::-1][:m])
        return m if returns else len(self.q)


@dataclass(frozen=True)
class TimedPath(Waypoints):
    """A path with the times at which it is driven."""

    trajectory: Trajectory


@dataclass(frozen=True)
class Pass:
    """One stretch of a session with the gauge, from rest to rest.

    Attributes:
        path: as it is driven, with the ids of what is measured on the way.
        heading: what a program calls it.
        load: force along the bar that is set for it [N], ``None`` without.
    """

    path: TimedPath
    heading: str
    load: float | None = None

    @property
    def trajectory(self) -> Trajectory:
        """The path in time."""
        return self.path.trajectory

    @property
    def marks(self) -> tuple[int, ...]:
        """Ids of what is measured on the way."""
        return tuple(int(v) for v in self.path.visit if v >= 0)


@dataclass(frozen=True)
class Course:
    """All that a program needs for one mounting of the gauge.

    Attributes:
        mounting: at which fixture and tool point.
        start: where its session starts and ends, in words.
        travel: the way there from home; it is driven back at the end.
        passes: what is driven with the gauge, in order; poses are one pass, both ways where asked.
        is_of_poses: whether it is a path through poses, which can be started at each of them.
        shortcuts: points of that path that are proven to be joined straight to its first, for such starts.
    """

    mounting: Mounting
    start: str
    travel: TimedPath
    passes: tuple[Pass, ...]
    is_of_poses: bool = False
    shortcuts: tuple[int, ...] = ()

    @classmethod
    def of_poses(
        cls, cell: Cell, mounting: Mounting, travel: TimedPath, measuring: TimedPath, shortcuts: tuple[int, ...]
    ) -> "Course":
        """Return the course through the poses at one mounting."""
        start, heading = cell.gauge.session_names(cell, mounting)
        return cls(mounting, start, travel, (Pass(measuring, heading),), True, shortcuts)

    @property
    def measuring(self) -> TimedPath:
        """The path through all poses."""
        return self.passes[0].path

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory through all poses."""
        return self.measuring.trajectory

    @property
    def duration(self) -> float:
        """Time of all passes [s]."""
        return sum(p.trajectory.duration_s for p in self.passes)


def reading_limits(cell: Cell, mounting: Mounting, bar: bool) -> ReadingLimits | None:
    """Limits of the gauge's own rate and acceleration while it is attached, else none."""
    gauge = cell.gauge
    if not (bar and np.isfinite(gauge.rate)):
        return None
    p_BX = cell.fixtures[mounting.fixture].p_BX
    return ReadingLimits(
        gauge.rate,
        gauge.acceleration,
        lambda q: bar_state(cell.map_position(q), p_BX).length,
        lambda q: bar_state(cell.map_position(q), p_BX).direction,
    )


def time_course(
    cell: Cell, mounting: Mounting, travel: Waypoints, measuring: Waypoints, shortcuts: tuple[int, ...] = ()
) -> Course:
    """Time the way to the mount pose and the measuring path (given one way)."""
    cell = cell.at(mounting)
    return Course.of_poses(
        cell,
        mounting,
        time_path(cell, travel, mounting, bar=False),
        time_measuring(cell, measuring, mounting),
        shortcuts,
    )


def time_measuring(cell: Cell, path: Waypoints, mounting: Mounting) -> TimedPath:
    """Time a measuring path, given one way, as it is driven: both ways where asked for, at rest at the poses or not."""
    moving = cell.motion.is_continuous
    if moving and cell.motion.both_ways:
        path = path.append_way_back()
    rest = np.where(path.visit >= 0, cell.rest_seconds, 0.0) * (path.blend == 0)
    return time_path(cell, path, mounting, bar=True, dwell=rest)


def time_path(cell: Cell, path: Waypoints, mounting: Mounting, bar: bool, dwell: Array | None = None) -> TimedPath:
    """Time a path with or without the bar, attached as ``mounting`` says; ``dwell`` (m,) [s] at its points."""
    trajectory = plan_trajectory(
        path.q,
        stop=path.blend == 0,
        blend_m=path.blend,
        tool_position=cell.map_position,
        tool_jacobian=cell.map_jacobian,
        limits=axis_limits(cell, bar),
        tool_speed=cell.gauge.leg_speeds(cell, path.visit) if bar else np.inf,
        dwell=0.0 if dwell is None else dwell,
        reading=reading_limits(cell, mounting, bar),
    )
    return TimedPath(path.q, path.visit, path.blend, trajectory)


Programs = tuple[tuple[str, tuple[ProgramFile, ...]], ...]
"""Files of the program in each dialect."""


@dataclass(frozen=True)
class Visit:
    """One pose in visiting order.

    Attributes:
        id: number of the pose; a repeated visit has its own, ``repeats`` names the first one's.
        q: controller angles, (N,) [rad].
        length: nominal bar length [m].
        mounting: at which fixture, and which of the tool's points.
        role: what the pose is for.
        approach: sign of each axis' last movement before the pose, (N,) of −1, 0, 1.
        repeats: id of the pose visited before, or ``None``.
        ball: which ball is centred there, or −1.
        contact: distance from the centre at which the uncalibrated robot meets it, at most (95 %) [m].
    """

    id: int
    q: Array
    length: float
    mounting: Mounting
    role: Role
    approach: tuple[int, ...]
    repeats: int | None = None
    ball: int = -1
    contact: float | None = None


@dataclass(frozen=True, kw_only=True)
class SessionDrive:
    """What is driven with the gauge held in one way, and what both collision engines say of it."""

    course: Course
    verdicts: tuple[Verdict, ...] = ()

    @property
    def mounting(self) -> Mounting:
        """At which fixture, and which of the tool's points."""
        return self.course.mounting


@dataclass(frozen=True, kw_only=True)
class Drive(SessionDrive):
    """The poses of one mounting as they are driven; the verdicts are on the measuring path and on the travel.

    Attributes:
        visits: poses in visiting order, the mount pose first and last.
        tour: order and its proof.
        path: measuring path from mount to mount, with support poses (one way).
        limits: the trajectory held against the limits.
    """

    visits: tuple[Visit, ...]
    tour: Tour
    path: ProvenPath
    limits: LimitReport

    @property
    def clearance(self) -> float:
        """Distance that no two bodies come nearer than, with the gauge or on the way to it [m]."""
        return min(v.clearance for v in self.verdicts)

    @property
    def trajectory(self) -> Trajectory:
        """The measuring path blended and timed, both ways where asked."""
        return self.course.trajectory


@dataclass(frozen=True, kw_only=True)
class SessionPlan:
    """The plan of a measuring session, whatever is measured.

    Attributes:
        cell: with its mount poses.
        seed: of everything random.
        drives: one a mounting of the gauge.
        notes: what a person should know (a pose replaced, a solver that failed, …).
        plan_id: 12 hex digits of a hash over the content.
        programs: files of each dialect.
    """

    cell: Cell
    seed: int
    drives: tuple[SessionDrive, ...]
    notes: tuple[str, ...] = ()
    plan_id: str = "0" * 12
    programs: Programs = ()

    @property
    def courses(self) -> tuple[Course, ...]:
        """What is driven, one course a mounting."""
        return tuple(d.course for d in self.drives)


@dataclass(frozen=True, kw_only=True)
class Plan(SessionPlan):
    """The plan of a session of poses.

    Attributes:
        pool: candidates; choice: those that are measured.
        certificate: no set of candidates, of the poses as chosen and of those found off the grid beats its value.
        curve: index and bound against the number of poses, where the index chose them.
        driven: the index over the trajectory as it is driven.
        separation: how surely it tells the findings of an identification from their rivals, where that was asked.
        forecast: the error that such robots have before it and keep after it, where it calibrates.
        targets: how far such robots are off at their targets, of one that no run has calibrated yet.
    """

    drives: tuple[Drive, ...]
    pool: PoseSet
    choice: PoseChoice
    certificate: Certificate
    curve: IndexCurve | None
    driven: float
    separation: Discrimination | None = None
    forecast: ErrorForecast | None = None
    targets: TargetForecast | None = None

    @property
    def expected_error(self) -> BayesianDesign | None:
        """The error that the robot would keep, where the poses were chosen by that."""
        return self.forecast if isinstance(self.forecast, BayesianDesign) else None

    def __repr__(self) -> str:
        """Name cell and plan, and say how many poses there are."""
        return f"Plan('{self.cell.name}', plan_id='{self.plan_id}', poses={len(self.choice.q)})"

    @property
    def reading_share(self) -> str:
        """Return how much of the planned time the robot waits for readings, in words; empty where it does not wait."""
        seconds = self.cell.gauge.reading_seconds
        count = sum(v.role != "mount" for d in self.drives for v in d.visits)
        return f"{count * seconds / 60:.0f} min of it for {count} readings of {seconds:g} s" if seconds else ""

    @property
    def by_index(self) -> bool:
        """Whether the index chose the poses: neither chance, for a validation, nor the error that is foreseen."""
        return self.expected_error is None and any(v.role == "calibrate" for d in self.drives for v in d.visits)


def motion_signs(q: Array) -> np.ndarray:
    """Signs of the last movement before each of the states (m, N), (m, N) of −1, 0, 1; the first has none."""
    step = np.diff(q, axis=0, prepend=q[:1])
    return np.sign(np.where(np.abs(step) > 1e-9, step, 0.0)).astype(int)
