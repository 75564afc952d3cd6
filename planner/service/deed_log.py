"""The log of deeds: who changed what and when."""

import time
from dataclasses import dataclass

from planner.service.database import Database


@dataclass(frozen=True)
class Deed:
    """Something that somebody did; ``id`` rises, ``at`` in seconds since 1970, ``status`` is that of the answer."""

    id: int
    at: float
    person: str
    address: str
    deed: str
    subject: str
    status: int


class DeedLog:
    """All deeds of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def add(self, person: str, address: str, deed: str, subject: str, status: int) -> None:
        """Add a deed to the log."""
        row = (time.time(), person, address, deed, subject[:200], status)
        with self._db.write() as db:
            db.execute("INSERT INTO deeds (at, person, address, deed, subject, status) VALUES (?, ?, ?, ?, ?, ?)", row)

    def list_deeds(self, person: str | None, before: int | None, most: int) -> list[Deed]:
        """Return the latest deeds, of one person or of all, before a number where one is given."""
        where, values = "1", list[object]()
        if person is not None:
            where, values = f"{where} AND person = ?", [*values, person]
        if before is not None:
            where, values = f"{where} AND id < ?", [*values, before]
        query = f"SELECT id, at, person, address, deed, subject, status FROM deeds WHERE {where} ORDER BY id DESC"
        return [Deed(*row) for row in self._db.read(f"{query} LIMIT ?", *values, most)]
