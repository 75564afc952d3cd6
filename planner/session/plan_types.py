"""What a plan is made of, stage by stage: the values that flow from the candidates to the program."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.design.bayesian_design import BayesianDesign
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.power import Discrimination
from planner.design.expected_errors import ErrorForecast
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_curves import IndexCurve
from planner.motion.path.verdict import ProvenPath, Verdict
from planner.motion.timing.trajectory import LimitReport, Trajectory
from planner.motion.tour.solve import Tour
from planner.programs.rendering import ProgramFile
from planner.runs.run import Mounting
from planner.session.course import Course, Role

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
    """

    drives: tuple[Drive, ...]
    pool: PoseSet
    choice: PoseChoice
    certificate: Certificate
    curve: IndexCurve | None
    driven: float
    separation: Discrimination | None = None
    forecast: ErrorForecast | None = None

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
