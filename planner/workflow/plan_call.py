"""The verb ``plan``, declared."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

from planner.cell.declared import CellWord
from planner.common.calls import Call, Option, ProgressKeyword
from planner.common.progress import no_progress
from planner.session.options import PlanOptions


@dataclass(frozen=True)
class PlanCall(PlanOptions, Call):
    """Plan a measuring session: poses, certificate, collision-free path, robot program, report."""

    verb = "plan"
    line = "Plan a measuring session: poses, path, robot program, report."
    function = "planner.workflow.planning:plan"
    draws = True

    cell: CellWord
    _: KW_ONLY
    time_limit: Annotated[
        float | None,
        Option(
            "seconds after which nothing new is searched; what that leaves open is said (exit code 5)",
            min=1,
            metavar="SECONDS",
        ),
    ] = None
    progress: ProgressKeyword = no_progress
