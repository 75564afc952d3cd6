"""What is ticked of the checklists of sessions: of each step the latest tick counts, by the clock of its device."""

import time
from datetime import UTC, datetime
from typing import Annotated

from pydantic import AwareDatetime, Field

from planner.common.schema import StrictModel
from planner.service.database import Database
from planner.service.job_store import UnknownJobError


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


class TickStore:
    """The ticks of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def merge(self, job: str, ticks: list[Tick], person: str) -> None:
        """Keep the ticks that are later than what is known of their steps; a clock that is ahead counts as now.

        Raises:
            UnknownJobError: there is no such job.
        """
        now = time.time()
        rows = [(job, t.step, t.done, min(t.at.timestamp(), now), person) for t in ticks]
        with self._db.write() as db:
            if db.execute("SELECT 1 FROM jobs WHERE id = ?", (job,)).fetchone() is None:
                raise UnknownJobError(f"there is no job {job}")
            db.executemany(
                "INSERT INTO ticks VALUES (?, ?, ?, ?, ?) ON CONFLICT (job, step) DO UPDATE SET"
                " done = excluded.done, at = excluded.at, person = excluded.person WHERE excluded.at > at",
                rows,
            )

    def list_ticks(self, job: str) -> list[KnownTick]:
        """Return what is known of a job's checklist."""
        rows = self._db.read("SELECT step, done, at, person FROM ticks WHERE job = ? ORDER BY step", job)
        return [KnownTick(step=s, done=bool(d), at=datetime.fromtimestamp(at, UTC), person=p) for s, d, at, p in rows]
