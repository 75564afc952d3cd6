"""``identify()``: from the log of a run to a calibrated robot, and its folder.

Which findings poses of a further session may tell from their rivals.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.cell.fleet_file import read_fleet
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.files import write_bytes, write_text
from planner.common.progress import Stages
from planner.common.result import FolderResult, Plot
from planner.common.summary import Summary
from planner.common.tables import NamedTable, Row, RowTable
from planner.common.units import from_mm
from planner.documents.baseline import NAME as BASELINE
from planner.documents.baseline import baseline_text
from planner.documents.calibrated_robot import calibrated_files, calibrated_meshes
from planner.documents.calibration import Calibration
from planner.documents.calibration_summary import summarize
from planner.documents.expected_error import NAME as EXPECTED_ERROR
from planner.documents.expected_error import (
    ExpectedErrorContent,
    expected_error_content,
    expected_error_csv,
    expected_error_text,
)
from planner.documents.residual_table import residuals_csv
from planner.effects.catalogue import catalogue
from planner.effects.effect import Role
from planner.identification.fleet_fit import RobotErrors, misfits_of
from planner.identification.pipeline import FitSettings
from planner.identification.pipeline import identify as fit_and_trace
from planner.inference.candidates import HUNDRED_TO_ONE
from planner.model.finding import Finding
from planner.model.gauge_frames import ToolPointPosition
from planner.model.identification_document import Estimate, Stage
from planner.next_session.planned_poses import foresee_more_poses, minutes_a_pose
from planner.release.suitability import judge_use
from planner.tracing.trace import trace
from planner.workflow.calibration_tables import error_rows, finding_row, parameter_row, stage_row, tool_row
from planner.workflow.core_calls import IdentifyCall
from planner.workflow.fit_access import FitAccess
from planner.workflow.fit_overview import fit_overview, is_hardly_better
from planner.workflow.measured_runs import MeasuredRuns, read_measured_runs


def can_be_told_apart(found: Calibration) -> bool:
    """Tell whether poses of a bar or wire may decide between a finding and a rival that the readings leave open.

    Both must be causes that poses show by themselves: not what needs a thermometer or another payload, no change in the
    middle of a run, and none without a name.
    """
    if found.run.readings.length is None:
        return False
    logged = found.run.samples
    planned = replace(logged, temperature=None, torque=None, payload=None, q_cmd=None, q_read=None, session=None)
    offered = [e for e in catalogue(found.setup, planned) if not e.has(Role.UNTRACED)]
    shown, with_inner = {e.name for e in offered}, {e.name for e in offered if e.nonlinear is not None}
    return any(
        f.name in shown and rival in shown and (chance is None or chance >= HUNDRED_TO_ONE)
        for cause in found.findings
        for f in cause.each
        if not (f.beside_stages and f.name in with_inner)  # a band, of which no one number is known
        for rival, chance in zip(f.rivals, f.rival_probabilities or [None] * len(f.rivals), strict=True)
    )


@dataclass(frozen=True)
class CalibrationResult(FitAccess, FolderResult):
    """An identified robot.

    Attributes:
        calibration: of it.
        cell: where it was measured.
        timing: seconds that each step took.
        errors_content: what ``expected_error.json`` says, where it was made already.

    Example:
        >>> found = identify("run.csv", plan="session/plan.json")  # doctest: +SKIP
        >>> found.parameters["theta2"].std  # rad  # doctest: +SKIP
        >>> found.write("calibrated")  # doctest: +SKIP
    """

    main_file = "identification.json"
    calibration: Calibration
    cell: Cell
    timing: Stages = field(default_factory=Stages)
    errors_content: ExpectedErrorContent | None = field(default=None, repr=False, compare=False)

    def overview(self) -> Summary:
        """Return how far off the robot is before and after, and why."""
        return fit_overview(self.calibration)

    def content(self) -> Mapping[str, Any]:
        """Return what ``identification.json`` says."""
        return self.calibration.content()

    @property
    def is_failed(self) -> bool:
        """Tell whether a tolerance was asked for that the robot with its measured tool does not keep."""
        use = self.calibration.use
        return use is not None and use.tolerance is not None and use.tools[0].answer == "no"

    def next_step(self, folder: Path) -> str:
        """Say how findings are told apart and programs are corrected, or first what makes the error smaller."""
        robot = self.cell.robot
        first = "" if robot.conventions else ", once robot.toml says how its controller counts ([controllers])"
        model = folder / "robot.toml"
        correct = f"edbb compensate PROGRAM --model {as_word(model)} -o CORRECTED corrects a program{first}"
        sought = "seeks poses that tell the causes apart, says how surely"
        apart = f"edbb plan CELL --separate {as_word(folder)} -o apart {sought}"
        more = f"edbb plan CELL --after {as_word(folder)} -o more plans the poses that lower the error most"
        separable = can_be_told_apart(self.calibration)
        if is_hardly_better(self.calibration) and (separable or self.calibration.more is not None):
            return apart if separable else more
        return f"{correct}\n{apart}" if separable else correct

    @property
    def parameters(self) -> NamedTable[Estimate]:
        """Every parameter of the robot as it is written, by its name, with its standard deviation (SI units)."""
        return NamedTable(self.calibration.estimates, parameter_row, lambda e: e.name)

    @property
    def findings(self) -> RowTable[Finding]:
        """The causes that the run shows, the likeliest first (SI units)."""
        return RowTable(self.calibration.findings, partial(finding_row, reading_unit=self.calibration.reading_unit))

    @property
    def tool(self) -> RowTable[ToolPointPosition]:
        """Where each measured tool point sits in the flange of the robot as it is written (SI units)."""
        return RowTable(self.calibration.frames.tool, tool_row)

    @property
    def stages(self) -> RowTable[Stage]:
        """The stages of the fit and their errors (SI units)."""
        return RowTable(self.calibration.stages, partial(stage_row, reading_unit=self.calibration.reading_unit))

    @property
    def expected_error(self) -> RowTable[Row]:
        """The tool's likely error of the nominal, the geometrically fitted and the released robot over the workspace.

        Empty where no robot was released.
        """
        released = self.calibration.released
        if released is None:
            return RowTable((), dict)
        errors = np.stack([released.likely_errors(f) for f in (None, released.geometry, released.fit)], axis=1)
        return RowTable(
            error_rows(
                self.calibration.setup.robot.joint_columns("q"),
                released.tool.q.tolist(),
                released.tool.position.tolist(),
                errors.tolist(),
            ),
            dict,
        )

    @property
    def simulated(self) -> bool:
        """Tell whether it is made of readings that nobody measured."""
        return bool(self.calibration.simulated)

    @property
    def alarm(self) -> str:
        """Say why the robot must not be used; that comes before everything else."""
        found = self.calibration
        return found.worse_than_nominal or (f"NOT CALIBRATED, do not use it: {found.refusal}" if found.refusal else "")

    @property
    def problems(self) -> tuple[str, ...]:
        """Return why the robot must not be used."""
        why = self.calibration.reason_not_to_use
        return (why if self._writes_robot else f"no robot was written: {why}",) if why else ()

    @property
    def _writes_robot(self) -> bool:
        """Tell whether ``robot.toml`` is written: of a robot worse than the nominal one too, which says so itself."""
        return not self.calibration.problems or self.calibration.worse_than_nominal is not None

    def fill(self, draft: Path) -> None:
        """Write ``residuals.csv``, the report and the robot; of a fit that failed its own checks no robot.

        One that is worse than the nominal robot says in its file not to use it, and goes without what others need.
        """
        # plotting: other commands start quicker without
        from planner.report.calibration_report import report_calibration

        found = self.calibration
        with self.timing.stage("report"):
            write_text(draft / "residuals.csv", residuals_csv(found))
            report_calibration(found).with_identity(self.cell, self.simulated).write(draft)
            if self._writes_robot:
                self.write_robot(draft)

    def write_robot(self, folder: Path) -> None:
        """Write the calibrated robot alone: ``robot.toml`` and what belongs to it."""
        files = dict(calibrated_files(self.calibration))
        released = self.calibration.released
        if self.calibration.reason_not_to_use:
            files.pop("robot.urdf", None)  # it has no room to say so
        elif released is not None:
            mounting = self.cell.gauge.mounting or self.calibration.run.plan_id or ""
            content = self.errors_content or expected_error_content(released, self.calibration.run)
            files[EXPECTED_ERROR] = expected_error_text(content, files["robot.toml"], mounting)
            files["expected_error.csv"] = expected_error_csv(released)
            known = self.calibration
            baseline = baseline_text(released, known.degrees_of_freedom, known.run, self.cell, files["robot.toml"])
            files |= {} if baseline is None else {BASELINE: baseline}
        for file, text in files.items():
            write_text(folder / file, text)
        for file, data in calibrated_meshes(self.calibration):
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            write_bytes(folder / file, data)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        robot, sound = ", robot.toml" if self._writes_robot else "", not self.calibration.reason_not_to_use
        urdf = ", robot.urdf" if sound and (folder / "robot.urdf").exists() else ""
        known = ", posterior.json" if sound and (folder / BASELINE).exists() else ""
        known += ", expected_error.csv" if sound and self.calibration.released is not None else ""
        return f"identification.json, residuals.csv, report.html{robot}{urdf}{known}"

    def preview(self) -> Plot:
        """Return the residuals stage by stage."""
        return self.plot_residuals()

    def plot_residuals(self) -> Plot:
        """Return the errors of the poses, before and after."""
        return self.plot("histogram")

    def plot(self, name: str) -> Plot:
        """Return one of the report's charts by its name.

        Raises:
            InputError: no such chart.
        """
        from planner.report.calibration_charts import draw_calibration_charts
        from planner.report.calibration_data import CalibrationFacts
        from planner.report.matplotlib_backend import find_plot

        return find_plot(draw_calibration_charts(CalibrationFacts(self.calibration)).every, name)


@called_with(IdentifyCall)
def identify(asked: IdentifyCall) -> CalibrationResult:
    """Identify a robot from measured runs: parameters with uncertainties, and the causes of what they leave.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
        NoSolutionError: the fit does not come to rest.

    Example:
        >>> found = identify("run.csv", plan="session/plan.json")  # doctest: +SKIP
        >>> found.parameters.to_frame()  # doctest: +SKIP
    """
    return fit_runs(read_measured_runs(asked))


def fit_runs(measured: MeasuredRuns) -> CalibrationResult:
    """Identify the robot of runs that were read.

    Raises:
        InputError: run and cell do not belong together.
        NoSolutionError: the fit does not come to rest.
    """
    asked, stages = measured.asked, measured.stages
    settings = FitSettings(asked.hold_out, asked.seed, asked.geometry, asked.release, asked.most_causes)
    with stages.stage("identification"):
        tracer, known = trace if asked.traces else None, (measured.run, measured.cell, measured.validation)
        found = fit_and_trace(*known, settings, lambda s: stages.say(s, 0, 0), tracer)
    return _result(
        found.model_copy(update={"planned_errors": measured.foreseen, "planned_targets": measured.planned}),
        measured.cell,
        asked,
        stages,
    )


def _result(found: Calibration, cell: Cell, asked: IdentifyCall, stages: Stages) -> CalibrationResult:
    """Return the calibration with what its robot is good for and what more poses would bring."""
    judged = _with_use(_beside_fleet(found, asked.fleet), cell, asked.tolerance_mm)
    released = None if judged.problems else judged.released
    content = None if released is None else expected_error_content(released, judged.run)
    complete = judged.model_copy(update={"more": foresee_more_poses(judged, cell, content)})
    tool = None if cell.file.use is None else cell.file.use.tool
    summary = summarize(complete, tool, minutes_a_pose(judged.run, judged.n_groups))
    return CalibrationResult(complete.model_copy(update={"summary": summary}), cell, stages, content)


def _beside_fleet(found: Calibration, fleet: Path | str | None) -> Calibration:
    """Return the calibration, warned where the robot's errors are not the fleet's."""
    if fleet is None:
        return found
    robot = found.setup.robot.nominal_robot
    errors = RobotErrors.of("this robot", found, robot)
    odd = tuple(m.sentence for m in misfits_of(errors, read_fleet(Path(fleet), robot.name)))
    return found.model_copy(update={"warnings": (*found.warnings, *odd)})


def _with_use(found: Calibration, cell: Cell, asked_mm: float | None) -> Calibration:
    """Return a calibration that says what its robot is good for; the file holds that where a tolerance is asked for."""
    if found.released is None or found.problems:
        return found
    stated_mm = None if cell.file.use is None else cell.file.use.tolerance_mm
    tolerance = asked_mm or stated_mm
    asked = None if tolerance is None else float(from_mm(tolerance))
    use = judge_use(found.released, cell.robot.repeatability, asked, cell.robot.repeatability_assumed)
    return found.model_copy(update={"good_for": use, "use": None if tolerance is None else use})
