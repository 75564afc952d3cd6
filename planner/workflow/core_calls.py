"""The verbs of the core, declared: ``plan``, ``identify``, ``export``, ``simulate`` and ``import``."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from planner.cell.declared import CELL, CellWord, FleetOption
from planner.common.calls import LANGUAGE, Call, Option, ProgressKeyword, Seed, upload_option
from planner.common.progress import no_progress
from planner.session.options import PlanOptions
from planner.workflow.declared import PLAN_FILE, RUNS, MeasuredPlan

if TYPE_CHECKING:
    from planner.cell.cell import Cell
    from planner.runs.run import Run
    from planner.workflow.plan_results import PosesResult, SessionResult, SimulationResult

STAGES = {
    "reading": 0.0, "placing the gauge": 0.02, "nominal robot": 0.03, "frames": 0.04, "geometry": 0.06, "rivals": 0.42,
    "detection limits": 0.46, "calibrated robot": 0.5, "report": 0.85,
}  # fmt: skip
"""Shares of the time of an identification at which its stages usually begin."""


@dataclass(frozen=True)
class IdentifyCall(Call):
    """Identify the robot from measured runs: parameters with uncertainties, errors before and after."""

    verb = "identify"
    line = "Identify the robot from measured runs."
    group = "Calibrate"
    function = "planner.workflow.identification:identify"
    starts = STAGES

    runs: Annotated["Run | SimulationResult | Path | str | Sequence[Path | str]", RUNS]
    _: KW_ONLY
    cell: Annotated[
        "Cell | Path | str | Sequence[Cell | Path | str] | None",
        Option(
            f"{CELL}, once for all runs or once for each (default: the cell.toml next to the plan or to each run)",
            metavar="CELL",
            typed=list[str] | None,
        ),
    ] = None
    plan: Annotated[
        "SessionResult | PosesResult | Path | str | Sequence[SessionResult | PosesResult | Path | str] | None",
        Option(
            "the plan that was measured, once for all runs or once for each",
            metavar="PLAN.json",
            typed=list[Path] | None,
        ),
    ] = None
    validate: Annotated[
        "Run | Path | str | None",
        # "validate" is a method of requests
        upload_option("a run kept out of the fit, to judge it", "RUN", request_name="validate_with"),
    ] = None
    fleet: FleetOption = None
    no_trace: Annotated[bool, Option("seek no causes of what geometry leaves")] = False
    geometry: Annotated[bool, Option("the calibrated robot holds geometry alone, and no causes are sought")] = False
    most_causes: Annotated[
        int | None, Option("at most so many causes with a name act together (default: any number)", min=0, max=25)
    ] = None
    hold_out: Annotated[float, Option("share of the groups held out at a time", min=0.02, max=0.5)] = 0.2
    tolerance_mm: Annotated[
        float | None,
        Option(
            "is the robot good enough for programs made offline, whose targets may be so far off (default: the cell's)",
            min=0.001,
            max=1000.0,
        ),
    ] = None
    priors: Annotated[
        "Mapping[str, float] | None",
        Option('one-sigma sizes of errors, {"theta2_deg": 0.05}, in place of those of the files', python_only=True),
    ] = None
    release: Annotated[
        bool, Option("whether a robot is released by the posterior; without, a trial takes a tenth", python_only=True)
    ] = True
    seed: Seed = 0
    progress: ProgressKeyword = no_progress

    @property
    def traces(self) -> bool:
        """Whether causes are sought."""
        return not (self.no_trace or self.geometry)


PLAN_STAGES = {
    "fixtures": 0.0, "candidates": 0.02, "roadmap": 0.14, "foresight": 0.28, "selection": 0.38, "separation": 0.56,
    "refinement": 0.58, "path": 0.66, "index curve": 0.83, "programs": 0.84, "report": 0.88,
}  # fmt: skip
"""Shares of the time of a plan at which its stages usually begin."""


@dataclass(frozen=True)
class PlanCall(PlanOptions, Call):
    """Plan a measuring session: poses, certificate, collision-free path, robot program, report."""

    verb = "plan"
    line = "Plan a measuring session: poses, path, robot program, report."
    group = "Plan"
    function = "planner.workflow.planning:plan"
    starts = PLAN_STAGES

    cell: CellWord
    _: KW_ONLY
    time_limit_s: Annotated[
        float | None,
        Option(
            "seconds after which nothing new is searched; what that leaves open is said (exit code 5)",
            min=1,
            metavar="SECONDS",
        ),
    ] = None
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class ExportCall(Call):
    """Write the robot program of a plan in any dialect; the cell.toml next to the plan must be the plan's own."""

    verb = "export"
    line = "Write the robot program of a plan in any dialect."
    group = "Use"
    function = "planner.workflow.plan_use:export"

    plan: Annotated[Path | str, PLAN_FILE]
    _: KW_ONLY
    dialect: Annotated[str, Option("robot language", pattern=LANGUAGE)]
    name: Annotated[
        str, Option("of the file, where the program is to be called as it is; ``-``: the plan's own", python_only=True)
    ] = "-"


@dataclass(frozen=True)
class SimulateCall(Call):
    """Simulate the measured run of a plan, on a robot with known or drawn errors."""

    verb = "simulate"
    line = "Simulate the measured run of a plan."
    group = "Measure"
    function = "planner.workflow.plan_use:simulate"

    plan: Annotated["SessionResult | PosesResult | Path | str", PLAN_FILE]
    _: KW_ONLY
    truth: Annotated[
        "Path | str | Mapping[str, Any] | None",
        Option("errors of the simulated robot: a TOML file, or its run as CSV", metavar="TRUTH", typed=Path | None),
    ] = None
    change: Annotated[
        str,
        Option(
            "added to an error of the truth, as in theta3_deg=0.2",
            metavar="KEY=VALUE",
            pattern=r"^[a-z]+[a-z0-9_]{0,40}=-?[0-9]{1,6}(\.[0-9]{1,9})?$",
        ),
    ] = ""
    seed: Seed = 0


@dataclass(frozen=True)
class ImportCall(Call):
    """Bring traces into the run format: by a map, the log of a plan's own program, or images of a camera's board."""

    verb = "import"
    line = "Bring controller and gauge traces into the run format."
    group = "Measure"
    function = "planner.workflow.plan_use:import_traces"

    traces: Annotated[
        Sequence[Path | str],
        Option(
            "controller and gauge traces; with --images a table of the joint angles",
            metavar="TRACE...",
            is_word=True,
            typed=list[Path],
        ),
    ]
    _: KW_ONLY
    map_file: Annotated[
        Path | str | None, Option("which column is what", metavar="MAP.toml", flag="--map", typed=Path | None)
    ] = None
    plan: MeasuredPlan = None
    dialect: Annotated[str | None, Option("of the plan's program, whose own log is the first trace")] = None
    images: Annotated[
        Path | str | None,
        Option(
            "folder of images whose names end in the numbers of their poses",
            metavar="DIR",
            typed=Path | None,
            is_served=False,
        ),
    ] = None
    board: Annotated[
        Path | str | None,
        Option(
            "the board in the images, or the cell with it", metavar="board.toml", typed=Path | None, is_served=False
        ),
    ] = None
