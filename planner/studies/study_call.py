"""The verb ``study``, declared."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

from planner.cell.declared import CellWord
from planner.common.calls import Call, Option, ProgressKeyword, Seed
from planner.common.choices import IndexName
from planner.common.progress import no_progress


@dataclass(frozen=True)
class StudyCall(Call):
    """Observability offline: what can be seen, with how many poses, from which fixture."""

    verb = "study"
    line = "Observability offline: what can be seen, and from where."
    function = "planner.studies.cell_study:study"

    cell: CellWord
    _: KW_ONLY
    index: Annotated[IndexName | None, Option("observability index (default: the cell's own)")] = None
    seed: Seed = 0
    progress: ProgressKeyword = no_progress
