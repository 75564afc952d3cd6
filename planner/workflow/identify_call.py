"""The verb ``identify``, declared."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from planner.cell.declared import CELL, FleetOption
from planner.common.calls import Call, Option, ProgressKeyword, Seed, upload_option
from planner.common.progress import no_progress
from planner.workflow.declared import RUNS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
