"""What an identification reads: runs, their cell, the poses of their plan that are kept out of the fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from planner.accuracy.precision import check_mastering
from planner.accuracy.tracker_nests import compare_nest_distances
from planner.cell.cell import Cell
from planner.cell.fleet_file import with_fleet
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.common.result import Result
from planner.common.units import from_mm
from planner.fit.run_setup import drop_unreadable, number_samples
from planner.kinematics.robot import Robot
from planner.model.own_priors import with_priors
from planner.runs.loader import load_runs
from planner.runs.run import NO_REFERENCE_READINGS, Run, read_reference_readings
from planner.session.document import PlanDocument, read_plan
from planner.simulation.simulated_run import SimulatedRun
from planner.workflow.core_calls import IdentifyCall
from planner.workflow.joint_runs import RunSource, are_sessions, load_planned_sessions, run_sources, single_value
from planner.workflow.run_checks import cell_of_run, check_unit, settle_angles, split_by_plan

if TYPE_CHECKING:
    from planner.workflow.plan_results import PlanResult

Runs = Run | Path | str | Sequence[Path | str]
"""One run or several, loaded or by path."""


@dataclass(frozen=True)
class MeasuredRuns:
    """All that an identification needs of files.

    Attributes:
        asked: by whom it is wanted.
        run: one, of all files.
        cell: where it was measured, with the priors that were given.
        validation: poses that no fit sees.
        foreseen: what each plan has foreseen after each pose [m].
        stages: what is said of its progress, and the seconds that each step took.
    """

    asked: IdentifyCall
    run: Run
    cell: Cell
    validation: Run | None
    foreseen: tuple[tuple[float, ...], ...]
    stages: Stages


def read_measured_runs(asked: IdentifyCall) -> MeasuredRuns:
    """Read all that an identification needs of files.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
    """
    measured = asked.runs.run if isinstance(asked.runs, Result) else asked.runs
    if not isinstance(measured, Run | Path | str):
        sources = run_sources(measured, asked.cell, asked.plan)
        if are_sessions(sources, asked.cell, asked.plan):
            return _read_sessions(sources, asked)
    given, plan = single_value(asked.cell, "--cell"), _plan_of_poses(single_value(asked.plan, "--plan"))
    cell = with_priors(with_fleet(_cell_of(given, plan), asked.fleet), asked.priors)
    stages, foreseen = Stages(asked.progress), tuple[float, ...]()
    with stages.stage("reading"):
        run = _with_reference_warnings(cell, load_any(measured, cell.robot), measured)
        other = None if asked.validate is None else load_any(asked.validate, cell.robot)
        if plan is not None:
            path = Path(plan) if isinstance(plan, Path | str) else Path("plan.json")
            document = read_plan(path, "drives") if isinstance(plan, Path | str) else plan.document()
            run, kept_out = split_by_plan(number_samples(run), path, document, cell)
            run = replace(run, plan_id=document.plan_id)
            other, foreseen = other or kept_out, _foreseen_errors(document)
        for each in (run, other):
            if each is not None:
                check_unit(each, cell)
        run, other = drop_unreadable(cell, run), None if other is None else drop_unreadable(cell, other)
        if other is not None:  # what was cut out of the poses kept apart is said as what was cut out of the others
            run = replace(run, warnings=tuple(dict.fromkeys((*run.warnings, *other.warnings))))
    return MeasuredRuns(asked, run, cell, other, (foreseen,) if foreseen else (), stages)


def _read_sessions(sources: Sequence[RunSource], asked: IdentifyCall) -> MeasuredRuns:
    """Read several sessions, each with its own fixtures and gauge."""
    stages = Stages(asked.progress)
    with stages.stage("reading"):
        run, cell, kept_out, plans = load_planned_sessions(sources)
        cell = with_priors(with_fleet(cell, asked.fleet), asked.priors)
        judge = asked.validate
        other = kept_out if judge is None else drop_unreadable(cell, load_any(judge, cell.robot))
    foreseen = tuple(() if plan is None else _foreseen_errors(plan) for plan in plans)
    return MeasuredRuns(asked, run, cell, other, foreseen, stages)


def _plan_of_poses(plan: object) -> "PlanResult | Path | str | None":
    """Return the plan that was measured; one of another kind, or of poses alone, is evaluated elsewhere.

    Raises:
        InputError: it is no plan of poses.
    """
    from planner.workflow.plan_results import PlanResult

    if plan is None or isinstance(plan, PlanResult | Path | str):
        return plan
    raise InputError(f"plan: a plan of poses, or the path of its plan.json, is needed, not a {type(plan).__name__}")


def _cell_of(cell: Cell | Path | str | None, plan: "PlanResult | Path | str | None") -> Cell:
    """Return the cell that is given, else that of the plan, read or not.

    Raises:
        InputError: neither is given, or the file is wrong.
    """
    if plan is None or isinstance(plan, Path | str):
        return cell_of_run(cell, plan)
    return cell_of_run(plan.plan.cell if cell is None else cell, None)


def load_any(runs: Runs, robot: Robot) -> Run:
    """Return one run: the one that is given, or that of the files that are given; angles within the joints' limits."""
    if not isinstance(runs, Run):
        paths = [Path(runs)] if isinstance(runs, Path | str) else [Path(r) for r in runs]
        runs = load_runs(paths, robot.n_joints, robot.axes_of)
    return settle_angles(runs, robot)


def _foreseen_errors(document: PlanDocument) -> tuple[float, ...]:
    """Return the error that a plan has foreseen after each pose [m]; empty where it has foreseen none."""
    after = () if document.foresight is None else document.foresight.after_mm
    return () if any(v is None for v in after) else tuple(float(from_mm(v)) for v in after if v is not None)


def _with_reference_warnings(cell: Cell, run: Run, source: Runs) -> Run:
    """Return the run, warned where indicators at the master ball, or nests, were not read as they should."""
    if cell.gauge.mastered_reading(cell) is None and not cell.nests:
        return run
    if isinstance(source, Run):
        readings = [source.beside] if isinstance(source, SimulatedRun) else []
    else:
        paths = [source] if isinstance(source, Path | str) else source
        readings = [read_reference_readings(Path(path)) for path in paths]
    checks = [m for m in (check_mastering(cell, r) for r in readings) if m is not None and not m.good]
    scales = (compare_nest_distances(cell, r) for r in readings or (NO_REFERENCE_READINGS,))
    return replace(run, warnings=(*run.warnings, *(m.text() for m in checks), *(s for s in scales if s)))
