"""The verb ``papers``, declared."""

from dataclasses import KW_ONLY, dataclass
from types import MappingProxyType
from typing import Annotated

from planner.common.calls import Call, Option, ProgressKeyword
from planner.common.progress import no_progress


@dataclass(frozen=True)
class PapersCall(Call):
    """Write the page of the two papers: each table, figure, equation and claim, and our number beside it."""

    verb = "papers"
    line = "The two papers: each statement, and our number beside it."
    function = "planner.reproduction.papers_result:papers"
    # shares of the time at which the groups of numbers usually begin
    starts = MappingProxyType(
        {"model": 0.0, "kuka": 0.01, "plan": 0.02, "loaded": 0.1, "accuracy": 0.15, "methods": 0.4}
    )

    _: KW_ONLY
    quick: Annotated[bool, Option("compute what takes seconds; other numbers are those of the release")] = False
    progress: ProgressKeyword = no_progress
