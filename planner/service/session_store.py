"""Sessions at the cell: one robot, one plan, a day and its people, with what each has ticked of the checklist.

Of each step the latest tick counts, by the clock of its device. A session that is begun again ends, and stays.
"""

import secrets
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

from pydantic import AwareDatetime, Field

from planner.common.errors import InputError
from planner.common.schema import Statement, StrictModel
from planner.service.database import Database
from planner.service.job_store import UnknownJobError


class UnknownSessionError(InputError):
    """A session that somebody names is not there."""


class EndedSessionError(InputError):
    """Something is ticked in a session that was begun again."""


class Tick(StrictModel):
    """A step of a checklist that was ticked, or ticked off again."""

    step: Annotated[str, Field(pattern="^step-[0-9]{1,3}$", examples=["step-1"])]
    done: bool
    at: AwareDatetime = Field(description="when, by the clock of the device")


class KnownTick(Tick):
    """A tick, and whose it is."""

    person: str = ""


class TickList(StrictModel):
    """What a device has ticked since it last said so."""

    ticks: Annotated[list[Tick], Field(max_length=200)]
    person: Annotated[Statement, Field(max_length=64)] = Field("", description="who ticks, where nobody has logged in")


@dataclass(frozen=True)
class CellSession:
    """A session at the cell; ``serial``: of the robot, empty where it is not known; times in seconds since 1970."""

    id: str
    plan: str
    serial: str
    begun: float
    person: str
    ended: float | None

    @property
    def begun_at(self) -> datetime:
        """When it was begun."""
        return datetime.fromtimestamp(self.begun, UTC)


class SessionStore:
    """The sessions of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def begin(self, plan: str, serial: str, person: str, anew: bool = False) -> CellSession:
        """Return the open session of a robot and a plan, or begin one; ``anew``: end the open one, which stays.

        Raises:
            UnknownJobError: there is no such plan.
        """
        with self._db.write() as db:
            if db.execute("SELECT 1 FROM jobs WHERE id = ?", (plan,)).fetchone() is None:
                raise UnknownJobError(f"there is no job {plan}")
            open_ = "FROM cell_sessions WHERE plan = ? AND serial = ? AND ended IS NULL"
            found = db.execute(f"SELECT id {open_}", (plan, serial)).fetchone()
            if found is not None and not anew:
                return self.get(found["id"])
            query = "UPDATE cell_sessions SET ended = ? WHERE plan = ? AND serial = ? AND ended IS NULL"
            db.execute(query, (time.time(), plan, serial))
            id = secrets.token_hex(12)  # bytes: as long as the identifier of a job
            row = (id, plan, serial, time.time(), person, None)
            db.execute("INSERT INTO cell_sessions VALUES (?, ?, ?, ?, ?, ?)", row)
            return self.get(id)

    def get(self, id: str) -> CellSession:
        """Return a session.

        Raises:
            UnknownSessionError: there is none.
        """
        rows = self._db.read("SELECT * FROM cell_sessions WHERE id = ?", id)
        if not rows:
            raise UnknownSessionError(f"there is no session {id}")
        return CellSession(*rows[0])

    def list_sessions(self, serial: str | None = None, plan: str | None = None, most: int = 200) -> list[CellSession]:
        """Return the sessions of a robot, of a plan, or all; the latest first."""
        query = "SELECT * FROM cell_sessions WHERE serial = ifnull(?, serial) AND plan = ifnull(?, plan)"
        return [CellSession(*r) for r in self._db.read(f"{query} ORDER BY begun DESC LIMIT ?", serial, plan, most)]

    def merge(self, id: str, ticks: list[Tick], person: str) -> None:
        """Keep the ticks that are later than what is known of their steps; a clock that is ahead counts as now.

        Raises:
            UnknownSessionError: there is no such session.
            EndedSessionError: some were ticked after it had ended; the others are kept.
        """
        now = time.time()
        rows = [(id, t.step, t.done, min(t.at.timestamp(), now), person) for t in ticks]
        with self._db.write() as db:
            ended = self.get(id).ended
            kept = [r for r in rows if ended is None or r[3] <= ended]
            db.executemany(
                "INSERT INTO session_ticks VALUES (?, ?, ?, ?, ?) ON CONFLICT (session, step) DO UPDATE SET"
                " done = excluded.done, at = excluded.at, person = excluded.person WHERE excluded.at > at",
                kept,
            )
        if len(kept) < len(rows):
            raise EndedSessionError("this session was begun again: go on in the open one of this robot")

    def list_ticks(self, id: str) -> list[KnownTick]:
        """Return what is known of a session's checklist."""
        rows = self._db.read("SELECT step, done, at, person FROM session_ticks WHERE session = ? ORDER BY step", id)
        return [KnownTick(step=s, done=bool(d), at=datetime.fromtimestamp(at, UTC), person=p) for s, d, at, p in rows]

    def people(self, session: CellSession) -> list[str]:
        """Return who began a session or ticked in it."""
        rows = self._db.read("SELECT DISTINCT person FROM session_ticks WHERE session = ? ORDER BY person", session.id)
        return [p for p in dict.fromkeys([session.person, *(r[0] for r in rows)]) if p]
