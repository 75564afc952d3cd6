"""``evaluate_loaded()``: from the logs of loaded circles to compliances and the circle without load, and its folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.cell import load_cell
from planner.errors import InputError
from planner.files import write_text
from planner.loaded import Loaded, Options, evaluate
from planner.loaded.joint import Joint, joint_fit
from planner.loaded.results import loaded_text
from planner.loaded.runs import averaged_run, averages_noise
from planner.loaded.table import curves_csv
from planner.plan.header import Loose
from planner.run import Run, load_runs, run_text
from planner.schema import read_json, validate
from planner.workflow.planning import Stages
from planner.workflow.writing import drafted, move_all


@dataclass(frozen=True)
class Evaluation:
    """What the loaded circles say, and with unloaded runs in one fit."""

    found: Loaded
    joint: Joint | None = None


class PlannedAs(Loose):
    """What a plan says of itself."""

    plan_id: str
    robot: str


def evaluate_loaded(
    runs: Sequence[Path],
    cell: str,
    stages: Stages,
    plan: Path | None = None,
    tracker: Path | None = None,
    options: Options | None = None,
    unloaded: Sequence[Path] = (),
) -> Evaluation:
    """Evaluate one or more runs of loaded circles.

    A tracker's run of the same circle, where one is given, is compared; runs of a bar without load are fitted together
    with the loaded one.

    Raises:
        InputError: a file is wrong, or runs, cell, plan and tracker do not belong together.
        NoSolutionError: the tracker cannot be placed.
    """
    where = load_cell(cell, planning=False)
    with stages.stage("reading"):
        run = load_runs(runs, where.robot.n_joints)
        other = None if tracker is None else load_runs([tracker], where.robot.n_joints)
        free = load_runs(unloaded, where.robot.n_joints) if unloaded else None
        if plan is not None:
            _check_plan(run, plan, where.robot.name)
    with stages.stage("evaluation"):
        found = evaluate(run, where, other, options)
        if free is None:
            return Evaluation(found)
        return Evaluation(found, joint_fit(where, free, averaged_run(found), averages_noise(found)))


def _check_plan(run: Run, path: Path, robot: str) -> None:
    plan = validate(read_json(path), PlannedAs, str(path))
    if run.plan_id is not None and run.plan_id != plan.plan_id:
        raise InputError(f"{run.name}: belongs to the plan {run.plan_id}, but {path} is the plan {plan.plan_id}")
    if plan.robot != robot:
        raise InputError(f"{path}: is a plan for {plan.robot}, but the cell has the robot {robot}")


def write_loaded(done: Evaluation, folder: Path, stages: Stages) -> list[Path]:
    """Write ``loaded.json``, ``curves.csv``, ``averaged.csv``, ``report.html`` and its pictures.

    ``averaged.csv`` is a run by itself, which other fits can take beside runs without load; ``joint.csv`` is both in
    one, as the joint fit saw them, where there was one.
    """
    from planner.report.loaded import write_loaded_report  # plotting: other commands start quicker without

    with drafted(folder) as draft, stages.stage("report"):
        write_text(draft / "loaded.json", loaded_text(done.found, done.joint))
        write_text(draft / "curves.csv", curves_csv(done.found))
        write_text(draft / "averaged.csv", run_text(averaged_run(done.found)))
        if done.joint is not None:
            write_text(draft / "joint.csv", run_text(done.joint.run))
        write_loaded_report(done.found, draft, done.joint)
        return move_all(draft, folder)
