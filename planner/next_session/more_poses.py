"""Foresees what more poses at the same places would bring of a robot that was identified just now.

It takes more readings at the poses of the run. ``edbb plan --after`` chooses among many more poses, so that its session
may bring more than is promised here.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.schema import validate
from planner.design.bayesian_design import BayesianPosterior, select_greedily
from planner.design.expected_errors import error_limit
from planner.documents.calibration import Calibration
from planner.documents.expected_error import NAME, ExpectedError, ExpectedErrorContent, ExpectedErrorFile
from planner.model.more_poses import MorePoses
from planner.next_session.assumptions import NEXT_SESSION_POSES
from planner.next_session.remaining_errors import CalibratedState, RemainingErrors, mounting_of
from planner.runs.run import Run


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
