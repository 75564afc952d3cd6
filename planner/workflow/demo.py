"""``edbb demo``: the whole chain on a shipped cell, on a simulated robot with a fault that the fit is not told."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.common.console import as_word
from planner.common.files import data_folder, write_bytes
from planner.common.progress import Progress, Stages, no_progress
from planner.common.result import FolderResult
from planner.common.summary import Fact, Summary
from planner.common.units import to_mm
from planner.effects.nonparametric import GEAR_CURVE
from planner.motion.planning_packages import can_plan
from planner.runs.writer import save_run
from planner.session.planned_session import PLAN, PlannedSession, load_session
from planner.simulation.simulated_run import SimulatedRun, planned_samples, simulate_run
from planner.simulation.truth import TruthEffectFile, draw_expected_truth, effects_from_file
from planner.workflow.identification import CalibrationResult, identify
from planner.workflow.plan_results import PlanResult
from planner.workflow.planning import plan

CELL = "comau-nj130/edbb"
SHIPPED = "comau-nj130/plan/plan.json"  # the plan of CELL, for computers on which nobody can plan
HIDDEN = "encoder once a turn"  # kind of the fault: an encoder out of centre
ONLY_SHIPPED = "comes with edbb; packages of planning are not installed here: edbb plan says what to do"
SIZES = (500.0, 900.0)  # [µrad] from the least to the largest: 0.5 to 0.9 mm at a metre, more than a gear's errors
SESSION, RUN, CALIBRATED = "session", "run.csv", "calibrated"


@dataclass(frozen=True)
class DemoResult(FolderResult):
    """The chain from plan to calibrated robot.

    Attributes:
        session: the plan, or the file of the shipped one.
        run: the simulated run.
        robot: what was identified of it.
        hidden: the fault: kind, place and size [µrad].
    """

    main_file = "demo.json"
    session: PlanResult | Path
    run: SimulatedRun
    robot: CalibrationResult
    hidden: tuple[str, str, float]

    @property
    def _names(self) -> tuple[bool, bool, bool]:
        """Whether the fault is a finding, whether a curve over its joint is, and whether it is a rival of one."""
        kind, on, _ = self.hidden
        name, findings = f"{kind}, {on}", self.robot.calibration.findings
        named = {f.name for c in findings for f in c.each}
        return name in named, f"{GEAR_CURVE}, {on}" in named, any(name in f.rivals for f in findings)

    @property
    def is_found(self) -> bool:
        """Tell whether the fault is among the findings, in a curve, or a rival that this run cannot tell from one."""
        return any(self._names)

    @property
    def verdict(self) -> str:
        """Say whether the fault was found."""
        named, curve, rival = self._names
        if named:
            return "the hidden fault was found"
        if curve:
            return f"the hidden fault is in the {GEAR_CURVE} of {self.hidden[1]}, which was found"
        return "the hidden fault is among the rivals of a finding" if rival else "the hidden fault was not found"

    @property
    def simulated(self) -> bool:
        """Tell that nobody measured it."""
        return True

    def overview(self) -> Summary:
        """Return the overview: the hidden fault, the findings, and the error before and after."""
        kind, on, size = self.hidden
        found, release = self.robot.calibration, self.robot.calibration.release
        shipped = isinstance(self.session, Path)
        facts: list[Fact] = [("plan", ONLY_SHIPPED)] if shipped else []
        facts += [("hidden", f"{kind}, {on}: {size:.0f} µrad, beside errors of every length and angle")]
        facts += [f for f in self.robot.overview().facts if f[0] in ("found", "rest")]
        facts.append(("so", self.verdict))
        if release is not None:
            before, after = (float(to_mm(v)) for v in (release.nominal_anywhere, found.workspace_error))
            facts.append(("tool error", f"{before:.3f} → {after:.3f} mm  rms over the workspace"))
        begun = "with a shipped plan" if shipped else "planned"
        return Summary(f"{found.robot}: {begun}, measured by simulation, calibrated", facts)

    def content(self) -> dict[str, Any]:
        """Return the hidden fault, and whether it was found."""
        kind, on, size = self.hidden
        hidden = {"effect": kind, "on": on, "size_urad": size}
        return {"schema": "edbb-demo/1", "simulated": True, "hidden": hidden, "found": self.is_found}

    def fill(self, draft: Path) -> None:
        """Write the plan, the run and the calibration, each as its own command does."""
        if isinstance(self.session, Path):
            (draft / SESSION).mkdir()
            for file in self.session.parent.iterdir():
                write_bytes(draft / SESSION / file.name, file.read_bytes())
        else:
            self.session.write(draft / SESSION)
        save_run(self.run, draft / RUN)
        self.robot.write(draft / CALIBRATED)

    def files(self, folder: Path) -> str:
        """Name the pages and the run."""
        plan = PLAN if isinstance(self.session, Path) else "report.html"
        return f"{SESSION}/{plan}, {RUN}, {CALIBRATED}/report.html"

    def next_step(self, folder: Path) -> str:
        """Say how the same is done with one's own robot, or the program of the shipped plan is written."""
        if isinstance(self.session, Path):
            return f"edbb export {as_word(folder / SESSION / PLAN)} --dialect krl -o program.src writes its program"
        return "edbb robots lists the robots and cells; edbb plan CELL -o session plans one of them"


def demo(cell: str = CELL, poses: int | None = None, seed: int = 0, progress: Progress = no_progress) -> DemoResult:
    """Run the chain on a cell: plan, simulated run of a robot with a hidden fault, identification.

    Where nobody can plan, the shipped plan of the default cell is taken.

    Args:
        cell: name or file of the cell.
        poses: their number; by default as many as the plan takes.
        seed: of the robot's errors and of its fault.
        progress: called with the stage, how much of it is done, and of how much.

    Raises:
        InputError: the cell cannot be read.
        NoSolutionError: a stage has no solution.
        MissingProgramError: a package of planning is not installed, and another plan than the shipped one is wanted.
    """
    session = _plan_of(cell, poses, progress)
    driven = load_session(session, "simulated") if isinstance(session, Path) else PlannedSession.of(session.plan)
    samples = planned_samples(driven.cell, driven.document, driven.courses)
    random = np.random.default_rng(seed)
    # joints that carry the arm: of others the tool tells less
    joint, size = int(random.choice((2, 3))), float(np.round(random.uniform(*SIZES)))
    on = f"joint {joint}"
    truth = draw_expected_truth(driven.cell, seed, samples)
    fault = TruthEffectFile(kind=HIDDEN, on=on, value=size, unit="urad")
    hidden = effects_from_file(Path("demo"), (fault,), truth.model.setup, samples)
    known = replace(truth, effects=(*truth.effects, *hidden))
    Stages(progress).say("simulation", 0, 0)
    run = simulate_run(driven.cell, driven.plan_id, samples, known, seed)
    robot = identify(run, plan=session, progress=progress)
    return DemoResult(session, run, robot, (HIDDEN, on, size))


def _plan_of(cell: str, poses: int | None, progress: Progress) -> PlanResult | Path:
    """Return the plan, or the file of the shipped one."""
    if (cell, poses) == (CELL, None) and not can_plan():
        return data_folder("robots") / SHIPPED
    session = plan(cell, poses=poses, progress=progress)
    assert isinstance(session, PlanResult)
    return session
