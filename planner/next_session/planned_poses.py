"""The next session of a robot that was calibrated: poses that lower the error that is still to be expected of it.

Foresees what more poses at the same places would bring of a robot that was identified just now.

It takes more readings at the poses of the run. ``edbb plan --after`` chooses among many more poses, so that its session
may bring more than is promised here.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.console import as_word
from planner.common.errors import NoSolutionError
from planner.common.progress import Stages
from planner.common.schema import validate
from planner.common.summary import Aside
from planner.common.units import to_mm
from planner.design.bayesian_design import BayesianPosterior, choose_bayesian_poses, select_greedily
from planner.design.expected_errors import EVERYWHERE, error_limit
from planner.design.pose_selection import judge_few_poses
from planner.documents.calibration import Calibration
from planner.documents.expected_error import NAME, ExpectedError, ExpectedErrorContent, ExpectedErrorFile
from planner.model.more_poses import MorePoses
from planner.next_session.assumptions import NEXT_SESSION_POSES
from planner.next_session.remaining_errors import CalibratedState, ErrorPlaces, RemainingErrors, mounting_of
from planner.runs.run import Run
from planner.session.planning import PoseSession, Selection


def foresee_more_poses(found: Calibration, cell: Cell, content: ExpectedErrorContent | None) -> MorePoses | None:
    """Return what ``NEXT_SESSION_POSES`` more poses would bring; ``None`` where it cannot be foreseen.

    That is where no robot was released, of other gauges than bars and wires, and of several set-ups in one.
    ``content``: what ``expected_error.json`` says of the robot, where it has one.
    """
    released, run = found.released, found.run
    if released is None or content is None or run.continuous or run.readings.length is None or not cell.fixtures:
        return None
    stands = released.fit.setup.gauge.kept_mounting(released.fit.setup).names
    if not stands or list(stands) != list(stands.values()):
        return None
    file = validate(content, ExpectedErrorFile, NAME)
    known = ExpectedError(file, cell.robot)
    cell = replace(cell, gauge=replace(cell.gauge, mounting=mounting_of(known)))
    before = CalibratedState(Path(), known, released.anywhere, released.at_most)
    pose = np.arange(len(run)) if run.samples.pose is None else run.samples.pose
    first = run.take(np.unique(pose, return_index=True)[1])
    unknown = RemainingErrors.of(before, cell, first.samples)
    white = unknown.white(first.samples)
    count = min(NEXT_SESSION_POSES, len(white))
    chosen = select_greedily(BayesianPosterior.prior(white, unknown.weight_per_prior), count, 0.0)
    left = BayesianPosterior.prior(white, unknown.weight_per_prior).with_readings(chosen)
    pace = minutes_a_pose(run, len(first))
    return MorePoses(
        poses=count,
        minutes=None if pace is None else count * pace,
        anywhere=unknown.state(left.square),
        at_most=error_limit(unknown, white[chosen]),
    )


def minutes_a_pose(run: Run, poses: int) -> float | None:
    """Return how long a pose took; ``None`` without a clock.

    A clock that goes back is that of the next file, which begins anew: what lies between two files counts for nothing.
    """
    t = run.samples.t
    if t is None or poses < 2:
        return None
    steps = np.diff(t)
    if np.any(steps == 0.0):
        return None
    begun = 1 + int((steps < 0.0).sum())
    return float(steps[steps > 0.0].sum()) / 60.0 / max(poses - begun, 1)


TOGETHER = (
    "identify this run together with those before, each in the folder of its plan: edbb identify BEFORE/run.csv "
    "NEXT/run.csv -o calibrated"
)
LEFT_STANDING = (
    "the gauge counts as left standing since the run before: leave its fixtures where they are and its zero as it is; "
    "edbb identify says if it was moved after all"
)


def evaluation_with_runs_before(run: Path) -> str:
    """Return the command that evaluates a run of such a session: with those before it, each beside its plan."""
    return f"edbb identify BEFORE/run.csv {as_word(run)} -o calibrated (all runs so far, each in its plan's folder)"


@dataclass(frozen=True)
class NextSessionChooser:
    """Chooses the poses of a session after others.

    Attributes:
        before: what the sessions before say.
        poses: their number; ``None``: ``NEXT_SESSION_POSES``, or as many as ``until`` needs.
        until: as many as bring down to this what 95 of 100 such robots stay below [m].
        counts: where the error counts; ``None``: in the whole workspace.
    """

    before: CalibratedState
    poses: int | None = None
    until: float | None = None
    counts: ErrorPlaces | None = None

    def __post_init__(self) -> None:
        if self.counts is None:  # else what is known counts at the places that are asked for, seen with the candidates
            self._check_goal(self.before.at_most, EVERYWHERE)

    def __call__(self, session: PoseSession, stages: Stages) -> Selection:
        """Choose the poses by the error that they leave; the index only judges them."""
        pool, cell = session.pool, session.cell
        poses = self.poses or (None if self.until else NEXT_SESSION_POSES)
        with stages.stage("foresight") as progress:
            unknown = RemainingErrors.of(self.before, cell, pool.samples, self.counts)
            self._check_goal(unknown.limit_before, unknown.where)
            expected = choose_bayesian_poses(cell, pool, poses, progress, unknown, self.until, stages.limit)
        session.notes.append(Aside(TOGETHER))
        if unknown.stands is not None:
            session.notes.append(LEFT_STANDING)
        with stages.stage("selection"):
            judged = judge_few_poses(cell, pool, expected.chosen, session.index, stages.limit)
            return Selection(judged, expected_error=expected)

    def _check_goal(self, at_most: float, where: str) -> None:
        """Refuse a goal [m] that is reached already ``where`` it counts.

        Raises:
            NoSolutionError: with what 95 of 100 such robots stay below.
        """
        if self.until is not None and at_most <= self.until:
            raise NoSolutionError(
                f"{self.before.folder}: the error is below {to_mm(at_most):.3f} mm {where} already, 95 % sure: "
                "nothing is to be measured for that; ask for less, or give --poses"
            )
