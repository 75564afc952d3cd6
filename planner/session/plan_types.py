"""What a plan is made of, stage by stage: the values that flow from the candidates to the program."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.design.bayesian_design import BayesianDesign
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.power import Discrimination
from planner.design.pose_selection import PoseChoice
from planner.design.selection.index_curves import IndexCurve
from planner.motion.path.verdict import ProvenPath, Verdict
from planner.motion.timing.trajectory import LimitReport, Trajectory
from planner.motion.tour.solve import Tour
from planner.programs.rendering import ProgramFile
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
        fixture: which fixture holds the bar.
        role: what the pose is for.
        approach: sign of each axis' last movement before the pose, (N,) of −1, 0, 1.
        repeats: id of the pose visited before, or ``None``.
        ball: which ball is centred there, or −1.
        contact: distance from the centre at which the uncalibrated robot meets it, at most (95 %) [m].
    """

    id: int
    q: Array
    length: float
    fixture: int
    role: Role
    approach: tuple[int, ...]
    repeats: int | None = None
    ball: int = -1
    contact: float | None = None


@dataclass(frozen=True)
class Drive:
    """What is driven with the bar on one fixture.

    Attributes:
        fixture: which fixture.
        visits: poses in visiting order, the mount pose first and last.
        tour: order and its proof.
        path: measuring path from mount to mount, with support poses (one way).
        travel: path from home to the mount pose without the bar.
        course: both, blended and timed as they are driven.
        limits: the trajectory held against the limits.
        verdicts: of both collision engines, on the measuring path and on the travel.
    """

    fixture: int
    visits: tuple[Visit, ...]
    tour: Tour
    path: ProvenPath
    travel: ProvenPath
    course: Course
    limits: LimitReport
    verdicts: tuple[Verdict, ...]

    @property
    def trajectory(self) -> Trajectory:
        """The measuring path blended and timed, both ways where asked."""
        return self.course.trajectory


@dataclass(frozen=True)
class Plan:
    """The whole plan of one cell.

    Attributes:
        plan_id: 12 hex digits of a hash over the content.
        curve: index and bound against the number of poses.
        driven: the index over the trajectory as it is driven.
        programs: files of each dialect.
        notes: what a person should know (a pose replaced, a solver that failed, …).
        separation: how surely it tells the findings of an identification from their rivals, where that was asked.
        foresight: the error that the robot would keep, where the poses were chosen by that.
    """

    plan_id: str
    cell: Cell
    seed: int
    pool: PoseSet
    choice: PoseChoice
    curve: IndexCurve
    drives: tuple[Drive, ...]
    driven: float
    programs: Programs
    notes: tuple[str, ...]
    separation: Discrimination | None = None
    foresight: BayesianDesign | None = None

    @property
    def by_index(self) -> bool:
        """Whether the index chose the poses: neither chance, for a validation, nor the error that is foreseen."""
        return self.foresight is None and any(v.role == "calibrate" for d in self.drives for v in d.visits)


def motion_signs(q: Array) -> np.ndarray:
    """Signs of the last movement before each of the states (m, N), (m, N) of −1, 0, 1; the first has none."""
    step = np.diff(q, axis=0, prepend=q[:1])
    return np.sign(np.where(np.abs(step) > 1e-9, step, 0.0)).astype(int)
