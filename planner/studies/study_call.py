"""The verb ``study``, declared."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

from planner.cell.declared import CellWord
from planner.common.calls import Call, Option, ProgressKeyword, Seed
from planner.common.choices import IndexName
from planner.common.progress import no_progress

STAGES = {
    "candidates": 0.0,
    "what is seen": 0.1,
    "index curves": 0.12,
    "fixture places": 0.3,
    "fixtures": 0.8,
    "pictures": 0.9,
}
"""Shares of the time of a study at which its stages usually begin."""


@dataclass(frozen=True)
class StudyCall(Call):
    """Observability offline: what can be seen, with how many poses, from which fixture."""

    verb = "study"
    line = "Observability offline: what can be seen, and from where."
    group = "Plan"
    function = "planner.studies.cell_study:study"
    starts = STAGES

    cell: CellWord
    _: KW_ONLY
    index: Annotated[IndexName | None, Option("observability index (default: the cell's own)")] = None
    seed: Seed = 0
    progress: ProgressKeyword = no_progress
