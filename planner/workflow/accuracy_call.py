"""The verb ``accuracy``, declared."""

from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Annotated

from planner.cell.declared import CellOption
from planner.common.calls import Call, Option, ProgressKeyword
from planner.common.progress import no_progress
from planner.workflow.declared import CALIBRATED, MeasuredPlan


@dataclass(frozen=True)
class AccuracyCall(Call):
    """Judge a robot before and after calibration by a tracker's run, or the precision of repeated centrings."""

    verb = "accuracy"
    line = "Judge a robot by a tracker's run, or repeated centrings."
    group = "Calibrate"
    function = "planner.workflow.accuracy:check_accuracy"
    needs_output = False

    run: Annotated[
        Path | str,
        Option(
            "a tracker's run, or one of repeated centrings",
            metavar="RUN",
            is_word=True,
            typed=Path,
            request_name="runs",
        ),
    ]
    _: KW_ONLY
    cell: CellOption = None
    plan: MeasuredPlan = None
    model: Annotated[Path | str | None, replace(CALIBRATED, typed=Path | None)] = None
    progress: ProgressKeyword = no_progress
