"""The next session of a robot that was calibrated: poses that lower the error that is still to be expected of it."""

from dataclasses import dataclass
from pathlib import Path

from planner.common.console import as_word
from planner.common.errors import NoSolutionError
from planner.common.progress import Stages
from planner.common.summary import Aside
from planner.common.units import to_mm
from planner.design.bayesian_design import choose_bayesian_poses
from planner.design.expected_errors import EVERYWHERE
from planner.design.pose_selection import judge_few_poses
from planner.next_session.assumptions import NEXT_SESSION_POSES
from planner.next_session.remaining_errors import CalibratedState, RemainingErrors
from planner.next_session.where_it_counts import ErrorPlaces
from planner.session.planning import PoseSession, Selection

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
                f"{self.before.folder}: 95 of 100 such robots are below {to_mm(at_most):.3f} mm {where} already: "
                "nothing is to be measured for that; ask for less, or give --poses"
            )
