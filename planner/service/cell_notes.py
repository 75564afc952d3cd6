"""What people call the cells that they have sent, and what they have written to them."""

from typing import Annotated

from pydantic import Field

from planner.common.schema import StrictModel
from planner.service.database import Database


class CellNote(StrictModel):
    """Name and note of a cell."""

    title: str = Field(default="", description="empty: the name of its file")
    note: str = ""


class CellChanges(StrictModel):
    """What is changed of a cell; what is not given stays."""

    title: Annotated[str, Field(max_length=120, pattern=r"^[^\x00-\x1f]*$")] | None = None
    note: Annotated[str, Field(max_length=2000)] | None = None


class CellNotes:
    """Names and notes of the cells of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def find(self, cell: str) -> CellNote:
        """Return the notes about a cell."""
        rows = self._db.read("SELECT title, note FROM cell_notes WHERE sha256 = ?", cell)
        return CellNote(title=rows[0]["title"], note=rows[0]["note"]) if rows else CellNote()

    def change(self, cell: str, changes: CellChanges) -> CellNote:
        """Change what is given; return what is known then."""
        with self._db.write() as db:
            db.execute("INSERT OR IGNORE INTO cell_notes VALUES (?, '', '')", (cell,))
            for name, value in changes.model_dump(exclude_none=True).items():
                db.execute(f"UPDATE cell_notes SET {name} = ? WHERE sha256 = ?", (value, cell))  # names of the model
        return self.find(cell)
