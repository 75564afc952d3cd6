"""How a verb is told a cell."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from planner.common.calls import Option, upload_option

if TYPE_CHECKING:
    from planner.cell.cell import Cell

CELL = "a cell file, or robot/cell for a shipped one"
CellWord = Annotated["Cell | Path | str", Option(CELL, metavar="CELL", is_word=True, typed=str)]
CellOption = Annotated[
    "Cell | Path | str | None",
    Option(f"{CELL} (default: the cell.toml next to the plan)", metavar="CELL", typed=str | None),
]
FleetOption = Annotated[
    Path | str | None,
    upload_option("what several robots of this kind have shown of how large its errors are", "FLEET.toml"),
]
