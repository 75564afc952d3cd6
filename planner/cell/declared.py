"""How a verb is told a cell."""

from typing import TYPE_CHECKING, Annotated

from planner.common.calls import Option

if TYPE_CHECKING:
    from pathlib import Path

    from planner.cell.cell import Cell

CELL = "a cell file, or robot/cell for a shipped one"
CellWord = Annotated["Cell | Path | str", Option(CELL, metavar="CELL", is_word=True, typed=str)]
CellOption = Annotated[
    "Cell | Path | str | None",
    Option(f"{CELL} (default: the cell.toml beside the plan)", metavar="CELL", typed=str | None),
]
