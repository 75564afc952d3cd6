"""``check_accuracy()``: from a tracker's or a head's run to figures of accuracy or precision, and their folder."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.accuracy.precision import RepeatedCentrings, judge_repeated_centrings, repeat_groups
from planner.accuracy.validation import Validation, validate_robot
from planner.cell.cell import Cell
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.progress import Stages
from planner.common.result import FolderResult, simulated_section
from planner.common.summary import Summary
from planner.runs.loader import load_runs
from planner.runs.run import Run, read_reference_readings
from planner.session.document import PlanDocument, check_run_of_plan, read_plan
from planner.workflow.accuracy_call import AccuracyCall
from planner.workflow.run_checks import cell_of_run, check_unit

GAUGES = ("tracker", "trical")


@dataclass(frozen=True)
class AccuracyCheck(FolderResult):
    """What was judged, and the cell that it stands in."""

    main_file = "accuracy.json"
    cell: Cell
    found: Validation | RepeatedCentrings
    stages: Stages = field(default_factory=Stages)

    def overview(self) -> Summary:
        """Return the errors before and after, or how closely centrings agree."""
        return self.found.overview()

    def content(self) -> dict[str, object]:
        """Return what ``accuracy.json`` says."""
        return self.found.content(self.cell.robot.name) | simulated_section(self.simulated)

    @property
    def simulated(self) -> bool:
        """Tell whether it is made of readings that nobody measured."""
        return self.found.run.simulated

    def fill(self, draft: Path) -> None:
        """Write ``report.html`` and, of a validation, ``errors.csv``."""
        from planner.report.accuracy_report import report_accuracy  # plotting takes long to load

        with self.stages.stage("report"):
            for name, text in self.found.tables().items():
                write_text(draft / name, text)
            report_accuracy(self.cell.robot.title, self.found).with_identity(self.cell, self.simulated).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return ", ".join(["accuracy.json, report.html", *self.found.tables()])

    def next_step(self, folder: Path) -> str:
        """Say how it is kept."""
        return f"edbb record RECORD --add {as_word(folder)} -o history keeps it with what is known of the robot"


@called_with(AccuracyCall)
def check_accuracy(asked: AccuracyCall) -> AccuracyCheck:
    """Judge a robot by a tracker's run, or a head of indicators by the centrings that it repeated.

    With a plan only its validation poses are judged; which centrings belong together stands in the plan.

    Raises:
        InputError: a file is wrong, or run, cell, plan and model do not belong together.
    """
    stages, path = Stages(asked.progress), Path(asked.run)
    where = cell_of_run(asked.cell, asked.plan)
    plan, model = (None if file is None else Path(file) for file in (asked.plan, asked.model))
    with stages.stage("reading"):
        run, said = load_runs([path], where.robot.n_joints, where.robot.axes_of), read_reference_readings(path)
        _check_kind(where, run)
        known = None if plan is None else read_plan(plan, "drives")
        if plan is not None and known is not None:
            check_run_of_plan(run, plan, known, where.robot.name)
    with stages.stage("judging"):
        if run.readings.position is not None:
            check_unit(run, where)
            part, others = (run, None) if known is None else _split_by_role(run, known)
            return AccuracyCheck(where, validate_robot(where, part, said, model, others), stages)
        if plan is None:
            raise InputError(f"{run.name}: which centrings belong together stands in the plan: give it with --plan")
        notes = ("a calibrated model changes nothing of repeated centrings: it was not used",) if model else ()
        return AccuracyCheck(where, judge_repeated_centrings(where, run, repeat_groups(plan), said, notes))


def _check_kind(cell: Cell, run: Run) -> None:
    if cell.gauge.kind not in GAUGES:
        raise InputError(
            f"{cell.path}: its gauge is '{cell.gauge.kind}'; accuracy is judged by a tracker, precision by a head of "
            "indicators (tracker, trical)"
        )
    cell.gauge.check_run(cell, run)
    cell.check_robot(run)


def _split_by_role(run: Run, plan: PlanDocument) -> tuple[Run, Run | None]:
    """The poses that the plan validates with and those it calibrates with; all, where the run does not say which is."""
    if run.samples.pose is None:
        return run, None
    mine, others = (np.isin(run.samples.pose, plan.ids(role)) for role in ("validate", "calibrate"))
    return run.take(mine) if mine.any() else run, run.take(others) if mine.any() and others.any() else None
