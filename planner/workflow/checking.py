"""``plan_check()`` and ``check()``: a few poses tell whether and where a calibrated robot has changed.

What the screen says of a planned check.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.checks.evaluation import CheckVerdict, evaluate_check
from planner.checks.planning import CheckChooser, resting_cell
from planner.checks.results import CheckForecast, verdict_content, verdict_overview
from planner.checks.words import FORECAST
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.errors import InputError
from planner.common.files import document_text, folder_of, write_text
from planner.common.progress import Stages
from planner.common.result import FolderResult, simulated_section
from planner.common.summary import Summary, cut_facts
from planner.common.units import MM
from planner.documents.baseline import Baseline
from planner.fit.run_setup import drop_unreadable
from planner.motion.planning_packages import require_planning_packages
from planner.runs.loader import load_runs
from planner.runs.run import Run
from planner.session.document import PlanDocument, check_run_of_plan, read_plan
from planner.session.evaluations import evaluation_of
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.session.planned_session import PlannedSession
from planner.session.planning import plan_session
from planner.simulation.simulated_run import planned_samples
from planner.workflow.check_calls import CheckCall, PlanCheckCall
from planner.workflow.plan_overview import plan_overview
from planner.workflow.plan_results import PlanResult
from planner.workflow.planning import pose_session
from planner.workflow.run_checks import cell_of_run, check_unit

if TYPE_CHECKING:
    from planner.report.page import Report


def check_overview(plan: Plan, forecast: CheckForecast) -> Summary:
    """Return the overview of a planned check: the drive, and the size from which on it shows each change."""
    whole = plan_overview(plan)
    facts = [f for f in whole.facts if f[0] != plan.choice.index]
    *changes, rates = forecast.facts()
    most = 3  # changes that a check shows, which are listed
    hidden = (forecast.hidden_because,) if forecast.hidden else ()
    details = [f for f in whole.details if f[0] != plan.choice.index]
    drive, *others = facts
    first, more = cut_facts(changes, most), changes[most:]
    return Summary(whole.title, [drive, *first, rates, *others], [*details, *more], (*whole.notes, *hidden))


@dataclass(frozen=True)
class CheckPlanResult(PlanResult):
    """A planned check, with what it will tell, and the calibration that it is judged by.

    Attributes:
        forecast: from which size on the check shows each change.
        model: the folder of the calibrated robot.

    Example:
        >>> planned = plan_check("session/cell.toml", model="calibrated")  # doctest: +SKIP
        >>> planned.write("check")  # doctest: +SKIP
    """

    forecast: CheckForecast = field(kw_only=True)
    model: Path | str = field(kw_only=True)

    def overview(self) -> Summary:
        """Return the overview: the drive, and the size from which on the check shows each change."""
        return check_overview(self.plan, self.forecast)

    def fill(self, draft: Path) -> None:
        """Write what every plan has, and ``shows.json``."""
        super().fill(draft)
        content = self.forecast.content() | {"model": Path(self.model).as_posix()}
        write_text(draft / FORECAST, document_text(content))

    def report(self) -> "Report":
        """Return the page of the plan, with what it shows."""
        from planner.report.plan_report import report_plan  # plotting takes long to load

        return report_plan(self.plan, self.forecast)

    def evaluation(self, plan: Path) -> str:
        """Return the command that judges the run of ``plan``, by the calibration that it was planned for."""
        return evaluation_of("run.csv", plan, None, calibrates=False, model=self.model)


@dataclass(frozen=True)
class CheckResult(FolderResult):
    """What a check found.

    Attributes:
        cell: where it was measured.
        verdict: whether the robot has changed, where, and what is to be done.
        simulated: whether nobody measured the run.

    Example:
        >>> check("check.csv", model="calibrated", plan="check/plan.json").verdict.smallest_p  # doctest: +SKIP
    """

    main_file = "check.json"
    cell: Cell
    verdict: CheckVerdict
    simulated: bool = False

    def overview(self) -> Summary:
        """Return the verdict, what to do, and why."""
        return verdict_overview(self.verdict)

    def content(self) -> Mapping[str, Any]:
        """Return what ``check.json`` says."""
        return {**verdict_content(self.verdict, self.cell.robot.name), **simulated_section(self.simulated)}

    def fill(self, draft: Path) -> None:
        """Write ``report.html`` and its picture."""
        from planner.report.check_report import report_check  # plotting takes long to load

        report_check(self.cell.robot.title, self.verdict).with_identity(self.cell, self.simulated).write(draft)

    @property
    def is_failed(self) -> bool:
        """Tell whether the check failed."""
        return not self.verdict.passed

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "check.json, report.html"

    def next_step(self, folder: Path) -> str:
        """Say how the check is kept; nothing where a reading is to be taken again first."""
        if self.verdict.doubtful:
            return ""
        return f"edbb record RECORD --add {as_word(folder)} -o history keeps it with the robot's other checks"


@called_with(PlanCheckCall)
def plan_check(asked: PlanCheckCall) -> CheckPlanResult:
    """Plan the poses that tell whether and where a robot has changed since its calibration.

    Raises:
        InputError: a file is wrong, or cell and model do not belong together.
        NoSolutionError: a stage has no solution.
        MissingProgramError: a package of planning is not installed.

    Example:
        >>> plan_check("session/cell.toml", model="calibrated").write("check")  # doctest: +SKIP
    """
    require_planning_packages()
    where, stages = load_cell(str(asked.cell)), Stages(asked.progress)
    known = Baseline.read(folder_of(Path(asked.model)), where)
    options = PlanOptions(seed=asked.seed, dialect=asked.dialect)
    session = pose_session(resting_cell(where), options, CheckChooser(known, asked.poses))
    plan = plan_session(session, session.options, stages)
    driven = PlannedSession.of(plan)  # with the sides from which joints come to the poses, as the run will have them
    samples = planned_samples(driven.cell, driven.document, driven.courses)
    return CheckPlanResult(plan, stages, forecast=CheckForecast.of(known, where, samples), model=asked.model)


def _pose_notes(run: Run, plan: PlanDocument) -> Iterator[str]:
    """Say which poses of the plan the run lacks, and which it has more than once."""
    if run.samples.pose is None:
        return
    found, times = np.unique(run.samples.pose, return_counts=True)
    missing = sorted({*plan.ids("calibrate", "repeat", "validate")} - {*found.tolist()})
    for said, poses in (("lacks", missing), ("counts more than once", found[times > 1].tolist())):
        if poses:
            yield f"{run.name}: the run {said}, of the plan's poses: {', '.join(str(p) for p in poses)}"


def _readable(cell: Cell, run: Run) -> Run:
    """Return the run without readings that the gauge cannot have made.

    Raises:
        InputError: where these are more than a few, which no check can be judged by.
    """
    kept = drop_unreadable(cell, run)
    most = 0.25  # share of the readings that may be beyond the gauge's range
    if len(kept) < (1.0 - most) * len(run):
        raise InputError(
            f"{kept.warnings[-1]}: {len(run) - len(kept)} of {len(run)} readings; is the gauge's zero set?"
        )
    return kept


@called_with(CheckCall)
def check(asked: CheckCall) -> CheckResult:
    """Judge the run of a check: has the robot changed since its calibration, where, and what is to be done.

    Raises:
        InputError: a file is wrong, or run, plan, cell and model do not belong together.

    Example:
        >>> check("check.csv", model="calibrated", plan="check/plan.json")  # doctest: +SKIP
    """
    plan, limit_mm = asked.plan, asked.limit_mm
    stages = Stages(asked.progress)
    with stages.stage("reading"):
        where = cell_of_run(asked.cell, plan)
        known = Baseline.read(folder_of(Path(asked.model)), where)
        measured = load_runs([Path(asked.run)], where.robot.n_joints, where.robot.axes_of)
        if plan is not None:
            document = read_plan(Path(plan), "drives")
            check_run_of_plan(measured, Path(plan), document, where.robot.name)
            measured = replace(measured, warnings=(*measured.warnings, *_pose_notes(measured, document)))
        check_unit(measured, where)
        measured = _readable(where, measured)
    with stages.stage("judging"):
        limit = None if limit_mm is None else limit_mm * MM
        return CheckResult(where, evaluate_check(known, where, measured, limit), measured.simulated)
