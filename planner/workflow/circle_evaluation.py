"""Runs of circles, with and without load: from their logs to figures, and their folders."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from planner.cell.cell import Cell
from planner.circular.document import load_circular_cell, read_circular_plan
from planner.circular.evaluation import CircularTest, circular_test_content, evaluate_circles
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.determinism import on_one_thread
from planner.common.files import write_text
from planner.common.numbers import number_of
from planner.common.progress import Stages
from planner.common.result import FolderResult, simulated_section
from planner.common.summary import Summary
from planner.common.units import DEG, UM
from planner.fit.run_setup import drop_unreadable
from planner.loaded.evaluation import evaluate_loaded_circles
from planner.loaded.joint_fit import JointFit, averaged_run, averages_noise, fit_jointly
from planner.loaded.results import averaged_curves_csv, compliance_text, loaded_content
from planner.loaded.types import LoadedEvaluation
from planner.runs.loader import load_runs
from planner.runs.writer import run_text
from planner.session.document import check_run_of_plan, read_plan_header
from planner.workflow.circle_calls import CircularCall, LoadedCall
from planner.workflow.run_checks import cell_of_run


@dataclass(frozen=True)
class CircularTestResult(FolderResult):
    """The figures of a circular test."""

    main_file = "circular.json"
    test: CircularTest
    cell: Cell
    stages: Stages = field(default_factory=Stages)
    simulated: bool = False

    def overview(self) -> Summary:
        """Return the circular deviations, reversals and centres."""
        test = self.test
        facts = []
        for c in test.circles:
            name = c.ring.circle.name if c.load is None else f"{c.ring.circle.name} {c.load:g} N"
            each = "  ".join(f"G({p.direction}) {p.G / UM:.1f}" for p in c.paths)
            both = "" if c.G_b is None or c.H is None else f"  G(b) {c.G_b / UM:.1f}  H {c.H / UM:.1f}"
            centre = ", ".join(f"{v / UM:.1f}" for v in c.centre.centre)
            extremes = f"F {min(p.F_min for p in c.paths) / UM:.1f} to {max(p.F_max for p in c.paths) / UM:.1f}"
            said = f"{each}{both}  {extremes}  D {c.D / UM:.1f} µm, centre [{centre}] µm taken off"
            facts.append((name, said))
        title = f"{test.run}: circular test of {test.robot}, plan {test.plan_id}"
        return Summary(title, facts, notes=test.warnings)

    def content(self) -> Mapping[str, Any]:
        """Return what ``circular.json`` says."""
        return {**circular_test_content(self.test), **simulated_section(self.simulated)}

    def fill(self, draft: Path) -> None:
        """Write ``report.html`` and its pictures."""
        from planner.report.circular_report import report_circular_test  # matplotlib: others start quicker without

        with self.stages.stage("report"):
            report_circular_test(self.test).with_identity(self.cell, self.simulated).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "circular.json, report.html"

    def next_step(self, folder: Path) -> str:
        """Say which command plans the poses that show the causes."""
        show = "edbb plan CELL -o DIR, CELL without [[circles]], plans the poses that show the cause"
        return f"look at {folder / 'report.html'}; {show}"


@called_with(CircularCall)
@on_one_thread
def evaluate_circular_runs(asked: CircularCall) -> CircularTestResult:
    """Evaluate one or more runs of a circular test; the cell beside its plan says where the bar stood.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
    """
    runs, plan, stages = asked.runs, asked.plan, Stages(asked.progress)
    file = read_circular_plan(plan)
    cell = load_circular_cell(plan, file)
    with stages.stage("reading"):
        run = load_runs(runs, cell.robot.n_joints, cell.robot.axes_of)
        check_run_of_plan(run, plan, file, cell.robot.name)
    with stages.stage("evaluation"):
        return CircularTestResult(evaluate_circles(cell, file, run), cell, stages, run.simulated)


@dataclass(frozen=True)
class LoadedTestEvaluation(FolderResult):
    """What the loaded circles say, and with unloaded runs in one fit."""

    main_file = "loaded.json"
    found: LoadedEvaluation
    cell: Cell
    joint: JointFit | None = None
    stages: Stages = field(default_factory=Stages)
    simulated: bool = False
    runs: tuple[Path, ...] = ()

    def overview(self) -> Summary:
        """Return the compliances, by the circles and by one fit with runs without load."""
        found, joint, c = self.found, self.joint, self.found.compliances
        each = [(name, compliance_text(c, k)) for k, name in enumerate(c.names)]
        facts = [("found", s) for s in found.sentences] + (each if joint is None else [])
        if joint is not None:
            left = f"{joint.rms[0] / UM:.1f} µm left without load, {joint.rms[1] / UM:.1f} µm under load"
            facts.append(("one fit", f"with runs without load: {len(joint.names)} parameters, {left}"))
            facts += [
                (e.name, f"{e.value * 1e6:.3f} ± {e.std * 1e6:.3f} µrad/Nm")
                for e in joint.estimates
                if e.name in c.names and e.std is not None
            ]
        title = f"{found.name}: {number_of(len(found.circles), 'circle')} of {found.robot}"
        by_circles = [] if joint is None else [("by circles", f"{name} {text}") for name, text in each]
        return Summary(title, facts, by_circles, found.warnings)

    def content(self) -> Mapping[str, Any]:
        """Return what ``loaded.json`` says."""
        return {**loaded_content(self.found, self.joint), **simulated_section(self.simulated)}

    @property
    def problems(self) -> tuple[str, ...]:
        """Return why the compliances must not be used."""
        why = (*self.found.problems, *(self.joint.problems if self.joint else ()))
        return ("the compliances failed their own check: " + "; ".join(why),) if why else ()

    def fill(self, draft: Path) -> None:
        """Write ``curves.csv``, ``averaged.csv``, ``report.html`` and its pictures.

        ``averaged.csv`` is a run by itself, which other fits can take beside runs without load; ``joint.csv`` is both
        in one, as the joint fit saw them, where there was one.
        """
        from planner.report.loaded_report import report_loaded_run  # plotting: other commands start quicker without

        with self.stages.stage("report"):
            write_text(draft / "curves.csv", averaged_curves_csv(self.found))
            write_text(draft / "averaged.csv", run_text(replace(averaged_run(self.found), simulated=self.simulated)))
            if self.joint is not None:
                write_text(draft / "joint.csv", run_text(self.joint.run))
            report_loaded_run(self.found, self.joint).with_identity(self.cell, self.simulated).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        joint = "" if self.joint is None else "joint.csv, "
        return f"loaded.json, curves.csv, averaged.csv, {joint}report.html, pictures"

    def next_step(self, folder: Path) -> str:
        """Say which command leads on to a corrected robot."""
        cell = f"--cell {as_word(self.cell.path)}"
        if self.joint is None:
            runs = " ".join(as_word(run) for run in self.runs)
            both = "adds runs without load (both planned by edbb plan-both)"
            return f"edbb loaded {runs} --unloaded FREE.csv {cell} -o DIR {both}"
        return f"edbb identify {as_word(folder / 'joint.csv')} {cell} -o calibrated"


@called_with(LoadedCall)
def evaluate_loaded(asked: LoadedCall) -> LoadedTestEvaluation:
    """Evaluate one or more runs of loaded circles.

    A tracker's run of the same circle, where one is given, is compared. Runs of a bar without load are fitted together
    with the loaded one.

    Raises:
        InputError: a file is wrong, or runs, cell, plan and tracker do not belong together.
        NoSolutionError: the tracker cannot be placed.
    """
    stages, plan, tracker, unloaded = Stages(asked.progress), asked.plan, asked.tracker, asked.unloaded
    where, runs = cell_of_run(asked.cell, plan), tuple(Path(run) for run in asked.runs)
    overshoot = None if asked.overshoot_deg is None else asked.overshoot_deg * DEG
    with stages.stage("reading"):
        run = drop_unreadable(where, load_runs(asked.runs, where.robot.n_joints, where.robot.axes_of))
        other = None if tracker is None else load_runs([tracker], where.robot.n_joints, where.robot.axes_of)
        free = load_runs(unloaded, where.robot.n_joints, where.robot.axes_of) if unloaded else None
        if plan is not None:
            check_run_of_plan(run, Path(plan), read_plan_header(Path(plan)), where.robot.name)
    with stages.stage("evaluation"):
        found = evaluate_loaded_circles(run, where, other, overshoot)
        if free is None:
            return LoadedTestEvaluation(found, where, None, stages, run.simulated, runs)
        averaged = replace(averaged_run(found), simulated=run.simulated)
        joint = fit_jointly(where, free, averaged, averages_noise(found))
        return LoadedTestEvaluation(found, where, joint, stages, run.simulated or free.simulated, runs)
