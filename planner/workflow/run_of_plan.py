"""The rows of a run held against the poses of the plan that it was driven by."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.file import FIRST_POINT
from planner.common.errors import InputError
from planner.runs.run import Run
from planner.session.document import PlanDocument, check_run_of_plan

FAR = np.deg2rad(10.0)  # from where the plan has its pose no sample stands that was measured there
LED = 4.0  # standard deviations of what the arm's errors turn a joint by where its ball is led to a seat, beside FAR


def split_by_plan(run: Run, path: Path, plan: PlanDocument, cell: Cell) -> tuple[Run, Run | None]:
    """Return the run without the plan's validation poses, and these.

    Raises:
        InputError: a plan for another robot; a run of another plan, or with rows at other poses than it has.
    """
    check_run_of_plan(run, path, plan, cell.robot.name)
    if run.samples.pose is None:
        return run, None
    aside = np.isin(run.samples.pose, plan.ids("validate"))
    strange = np.setdiff1d(run.samples.pose[run.samples.pose >= 0], plan.ids())
    if len(strange):
        raise InputError(f"{run.name}: pose {strange[0]} is not in {path} (there: 0 … {max(plan.ids())})")
    _check_places(run, path, plan)
    if not run.continuous:
        check_angles(run, path, plan, cell)
    if not aside.any() or aside.all():
        return run, None
    return run.take(~aside), replace(run.take(aside), name=f"{run.name}, validation poses")


def check_angles(run: Run, path: Path, plan: PlanDocument, cell: Cell) -> None:
    """Refuse a run whose samples stand elsewhere than the plan has their poses.

    Raises:
        InputError: naming row, pose and axis, and by how much it may be off.
    """
    from planner.design.candidates.balls import led_turns  # collision engines: a run without a plan does without

    assert run.samples.pose is not None
    planned = {p.id: np.deg2rad(p.q_deg) for p in plan.poses if len(p.q_deg) == cell.robot.n_joints}
    rows = [k for k, pose in enumerate(run.samples.pose.tolist()) if pose in planned]
    if not rows:
        return
    q = np.array([planned[pose] for pose in run.samples.pose[rows].tolist()])
    off, limit = np.abs(run.samples.q[rows] - q), FAR + LED * led_turns(cell, q)
    for k, row in enumerate(rows):
        axis = int((off[k] - limit[k]).argmax())
        if off[k, axis] > limit[k, axis]:
            raise InputError(
                f"{run.where(row)}: pose {run.samples.pose[row]} was measured with axis {axis + 1} "
                f"{np.rad2deg(off[k, axis]):.1f} deg off, by {path} (at most {np.rad2deg(limit[k, axis]):.1f} deg"
                f"{_led_text(cell)}): are the poses numbered right, and is the plan the one that was driven?"
            )


def _led_text(cell: Cell) -> str:
    return " by the errors that robot, tool and artifact may have" if cell.gauge.at_balls else ""


def _check_places(run: Run, path: Path, plan: PlanDocument) -> None:
    """Refuse a run that measured a pose elsewhere than the plan has it: at another ball, fixture or tool point."""
    assert run.samples.pose is not None
    planned = {p.id: p for p in plan.poses}
    looks = (
        ("ball", run.readings.ball, run.balls), ("fixture", run.samples.place, run.places),
        ("point", run.samples.point, run.points),
    )  # fmt: skip
    for what, which, names in looks:
        if which is None or names == ("",):
            continue
        pairs, first = np.unique(np.stack([run.samples.pose, which]), axis=1, return_index=True)
        for k, (pose, at) in sorted(zip(first.tolist(), pairs.T.tolist(), strict=True)):
            only = FIRST_POINT if what == "point" else None  # a plan for one point of the tool names none
            wanted = (getattr(planned[pose], what) or only) if pose in planned else None
            if wanted and names[at] and names[at] != wanted:
                raise InputError(
                    f"{run.where(k)}: pose {pose} was measured at {what} '{names[at]}', but {path} has it at '{wanted}'"
                )
