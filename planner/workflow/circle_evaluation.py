"""Runs of circles, with and without load: from their logs to figures, and their folders."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.cell.reading import load_cell
from planner.common.determinism import on_one_thread
from planner.common.files import document_text, write_text
from planner.common.progress import Stages
from planner.instruments.circular.evaluation import CircularTest, circular_test_content, evaluate_circles
from planner.instruments.circular.plan import read_circular_plan
from planner.instruments.circular.planned_test import load_circular_cell
from planner.instruments.loaded.evaluation import LoadedOptions
from planner.instruments.loaded.evaluation import evaluate_loaded as evaluate
from planner.instruments.loaded.joint_fit import JointFit, averaged_run, averages_noise, fit_jointly
from planner.instruments.loaded.results import curves_csv, loaded_content
from planner.instruments.loaded.types import LoadedEvaluation
from planner.runs.loader import load_runs
from planner.runs.writer import run_text
from planner.session.document import check_run_of_plan, read_plan_header
from planner.workflow.writing import draft_folder, move_all


@on_one_thread
def evaluate_circular_runs(runs: Sequence[Path], plan: Path, stages: Stages) -> CircularTest:
    """Evaluate one or more runs of the circular test at ``plan``; the cell beside it says where the bar stood.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
    """
    file = read_circular_plan(plan)
    cell = load_circular_cell(plan, file)
    with stages.stage("reading"):
        run = load_runs(runs, cell.robot.n_joints)
    with stages.stage("evaluation"):
        return evaluate_circles(cell, file, run)


def write_circular_test(test: CircularTest, folder: Path, stages: Stages) -> list[Path]:
    """Write ``circular.json``, ``report.html`` and its pictures: all of it, or nothing."""
    from planner.report.circular_report import report_circular_test  # matplotlib: other commands start quicker without

    with draft_folder(folder) as draft, stages.stage("report"):
        write_text(draft / "circular.json", document_text(circular_test_content(test)))
        report_circular_test(test).write(draft)
        return move_all(draft, folder)


@dataclass(frozen=True)
class LoadedTestEvaluation:
    """What the loaded circles say, and with unloaded runs in one fit."""

    found: LoadedEvaluation
    joint: JointFit | None = None


def evaluate_loaded(
    runs: Sequence[Path],
    cell: str,
    stages: Stages,
    plan: Path | None = None,
    tracker: Path | None = None,
    options: LoadedOptions | None = None,
    unloaded: Sequence[Path] = (),
) -> LoadedTestEvaluation:
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
            check_run_of_plan(run, plan, read_plan_header(plan), where.robot.name)
    with stages.stage("evaluation"):
        found = evaluate(run, where, other, options)
        if free is None:
            return LoadedTestEvaluation(found)
        return LoadedTestEvaluation(found, fit_jointly(where, free, averaged_run(found), averages_noise(found)))


def write_loaded(done: LoadedTestEvaluation, folder: Path, stages: Stages) -> list[Path]:
    """Write ``loaded.json``, ``curves.csv``, ``averaged.csv``, ``report.html`` and its pictures.

    ``averaged.csv`` is a run by itself, which other fits can take beside runs without load; ``joint.csv`` is both in
    one, as the joint fit saw them, where there was one.
    """
    from planner.report.loaded_report import report_loaded  # plotting: other commands start quicker without

    with draft_folder(folder) as draft, stages.stage("report"):
        write_text(draft / "loaded.json", document_text(loaded_content(done.found, done.joint)))
        write_text(draft / "curves.csv", curves_csv(done.found))
        write_text(draft / "averaged.csv", run_text(averaged_run(done.found)))
        if done.joint is not None:
            write_text(draft / "joint.csv", run_text(done.joint.run))
        report_loaded(done.found, done.joint).write(draft)
        return move_all(draft, folder)
