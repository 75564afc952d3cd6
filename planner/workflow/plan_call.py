"""The verb ``plan``, declared."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

from planner.cell.declared import CellWord
from planner.common.calls import Call, Option, ProgressKeyword
from planner.common.progress import no_progress
from planner.session.options import PlanOptions

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
    draws = True

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
