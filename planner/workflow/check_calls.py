"""The verbs ``plan-check`` and ``check``, declared."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated

from planner.cell.declared import CellOption, CellWord
from planner.common.calls import Call, Dialects, Option, ProgressKeyword, Seed
from planner.common.progress import no_progress
from planner.workflow.declared import CALIBRATED, MeasuredPlan

Model = Annotated[Path | str, CALIBRATED]


@dataclass(frozen=True)
class PlanCheckCall(Call):
    """Plan about ten poses that tell whether and where a robot has changed since its calibration."""

    verb = "plan-check"
    line = "Plan ten poses that tell whether a robot has changed."
    group = "Keep"
    function = "planner.workflow.checking:plan_check"

    cell: CellWord
    model: Model
    _: KW_ONLY
    poses: Annotated[int, Option("number of poses", min=4, max=60)] = 10
    seed: Seed = 0
    dialect: Dialects = ()
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class CheckCall(Call):
    """Judge the run of a check: has the robot changed, where most likely, and what is to be done."""

    verb = "check"
    line = "Judge a check: what has changed, and what to do."
    group = "Keep"
    function = "planner.workflow.checking:check"

    run: Annotated[Path | str, Option("the run of a check, .csv or .parquet", metavar="RUN", is_word=True, typed=Path)]
    model: Model
    _: KW_ONLY
    plan: MeasuredPlan = None
    cell: CellOption = None
    limit_mm: Annotated[
        float | None,
        Option("motion of the tool that is allowed (default: any change fails)", min=0.0, max_served=100.0),
    ] = None
    progress: ProgressKeyword = no_progress
