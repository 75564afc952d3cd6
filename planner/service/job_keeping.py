"""What is kept of jobs and what may go: titles and notes, archive, deletion, and the sweep by age and size.

A job stays as long as something needs it: it runs, a record of a robot cites its result, or another job starts from it.
Files are kept by their content, and go with the last job and upload that names them.
"""

import logging
import sqlite3
import threading
import time
from collections.abc import Iterable, Sequence
from typing import Annotated

from pydantic import Field

from planner.common.errors import InputError
from planner.common.schema import StrictModel
from planner.service.database import NAMED, Database
from planner.service.file_store import FileStore, UnknownFileError
from planner.service.job_record import JobRecord
from planner.service.job_store import JobCheck, JobStore, is_named
from planner.service.record_index import RecordIndex
from planner.service.settings import DAY_S, Retention
from planner.service.standing import read_check

LOG = logging.getLogger("edbb.service")
SESSIONS = ("cell_sessions", "plan")  # table, and what names the job there


class KeptJobError(InputError):
    """A job cannot be deleted, as something needs it."""


class QuotaError(InputError):
    """A person has as much as one may."""


class JobChanges(StrictModel):
    """What is changed of a job."""

    title: Annotated[str, Field(min_length=1, max_length=120, pattern=r"^[^\x00-\x1f]*$")] | None = None
    note: Annotated[str, Field(max_length=2000)] | None = None
    archived: bool | None = Field(default=None, description="kept for good, and not in the list")


class JobKeeper:
    """Changes and deletes jobs of a store."""

    def __init__(self, database: Database, jobs: JobStore, files: FileStore, records: RecordIndex) -> None:
        self._db, self._jobs, self._files, self._records = database, jobs, files, records

    def change(self, id: str, changes: JobChanges, check: JobCheck = lambda job: None) -> JobRecord:
        """Change what is given; ``check`` raises what forbids it, of the job as it is at that moment.

        Raises:
            UnknownJobError: there is no such job.
        """
        with self._db.write() as db:
            check(self._jobs.get(id))
            for name, value in changes.model_dump(exclude_none=True).items():
                db.execute(f"UPDATE jobs SET {name} = ? WHERE id = ?", (value, id))  # names of the model's fields
            return self._jobs.get(id)

    def delete(self, id: str, check: JobCheck = lambda job: None) -> None:
        """Delete a job, the views that pages have made of it, and the files that nothing else names.

        ``check`` raises what forbids it, of the job as it is at that moment.

        Raises:
            UnknownJobError: there is no such job.
            KeptJobError: something needs it.
        """
        with self._records.hold_alone():  # what is deleted is not added to a record meanwhile
            if not self._records.refresh(now=True):
                raise KeptJobError("the records of robots are being read, and may cite it; try again in a moment")
            with self._db.write() as db:
                contents = self._delete_rows(db, id, check)
        # only once the jobs are gone for good: a crash may leave files that nobody names, never a job without its own
        self._remove_unnamed_files(contents)

    def delete_upload(self, sha256: str, person: str | None) -> None:
        """Forget that a person (``None``: anybody) has sent a file, and remove it where nothing else names it.

        Raises:
            UnknownFileError: that person has not sent it.
            KeptJobError: a job starts from it.
        """
        with self._db.write() as db:
            query = "SELECT job FROM inputs WHERE sha256 = ? LIMIT 1"
            job = db.execute(query, (sha256,)).fetchone()
            if job is not None:
                raise KeptJobError(f"the job {job['job']} starts from the file {sha256[:12]}…; delete that first")
            of = "DELETE FROM uploads WHERE sha256 = ? AND person = ifnull(?, person)"
            if not db.execute(of, (sha256, person)).rowcount:
                raise UnknownFileError(f"there is no file {sha256[:12]}… that you have sent")
        self._remove_unnamed_files([sha256])

    def _remove_unnamed_files(self, contents: Iterable[str]) -> None:
        """Remove the files of these hashes that nothing names any more."""
        with self._files.hold_files(), self._db.write() as db:  # nobody brings or names one meanwhile
            for sha256 in contents:
                if not is_named(db, sha256):
                    self._files.path(sha256).unlink(missing_ok=True)

    def _delete_rows(self, db: sqlite3.Connection, id: str, check: JobCheck) -> set[str]:
        """Delete what the database has of a job and of its views; return the hashes of their files."""
        job, named_by = self._jobs.get(id), _jobs_naming(db, id)
        check(job)
        reason = _reason_to_keep(db, job, named_by) or self._binding(db, job)
        if reason:
            raise KeptJobError(f"the {job.kind} {id} cannot be deleted: {reason}")
        gone = [id, *(other["id"] for other in named_by if other["task"])]
        contents = {c for one in gone for c in _contents(db, one)}
        for one in gone:
            ticks = "DELETE FROM session_ticks WHERE session IN (SELECT id FROM cell_sessions WHERE plan = ?)"
            db.execute(ticks, (one,))
            for table, key in (("events", "job"), ("outputs", "job"), ("inputs", "job"), ("askers", "job"), SESSIONS):
                db.execute(f"DELETE FROM {table} WHERE {key} = ?", (one,))
            db.execute("DELETE FROM jobs WHERE id = ?", (one,))
        return contents

    def _binding(self, db: sqlite3.Connection, job: JobRecord) -> str:
        """Return of which robot a check has found a change: it binds the calibration, and does not just go."""
        query = "SELECT serial FROM recorded JOIN inputs ON document_sha256 = sha256 WHERE job = ? AND withdrawn = 0"
        row = db.execute(query, (job.id,)).fetchone() if job.kind == "check" else None
        found = next((o for o in self._jobs.outputs(job.id) if o.name == "check.json"), None)
        if row is None or found is None or read_check(self._files.path(found.sha256)).passed:
            return ""
        return f"it has found a change of the robot {row['serial']}; withdraw it in the record with a reason"

    def sweep(self, kept: Retention, now: float) -> int:
        """Delete what is older, and the oldest while the store is larger, than is to be kept; return how many jobs.

        Nothing goes that is archived or needed; what only serves pages goes first, then files that were sent and from
        which no job starts.
        """
        task_days = 7.0  # after which views, checks and files that no job needs go: somebody may be about to use them
        task_end = now - task_days * DAY_S
        count = sum(self._try_delete(id, task_end) for id in self._list_ended_jobs(task_end, tasks=True))
        if kept.age_s is not None:
            end = now - kept.age_s
            count += sum(self._try_delete(id, end) for id in self._list_ended_jobs(end))
            self._drop_old_uploads(min(end, task_end))
        if kept.size_bytes is not None:
            candidates = iter([*self._list_ended_jobs(now, tasks=True), *self._list_ended_jobs(now)])
            while self.size_bytes() > kept.size_bytes:
                if self._drop_old_uploads(task_end):
                    continue
                if (id := next(candidates, None)) is None:
                    break
                count += self._try_delete(id, now)
        return count

    def remove_old_uploads(self, before: float) -> int:
        """Remove files that came before a moment [s since 1970] and that nothing names; return how many.

        A crash, or a job that was tried again, has left them.
        """
        named = {row["sha256"] for row in self._db.read(NAMED)}
        with self._files.hold_files():  # nobody removes one meanwhile
            there = [path for path in self._files.folder.glob("??/*") if path.name not in named]
            left = [path.name for path in there if path.stat().st_mtime < before]
        if left:
            self._remove_unnamed_files(left)
        return len(left)

    def _drop_old_uploads(self, before: float) -> int:
        """Remove the files that were sent before a moment [s since 1970] and from which no job starts."""
        unneeded = "SELECT DISTINCT sha256 FROM uploads WHERE at < ? AND sha256 NOT IN (SELECT sha256 FROM inputs)"
        with self._db.write() as db:
            gone = [row["sha256"] for row in db.execute(unneeded, (before,)).fetchall()]
            db.executemany("DELETE FROM uploads WHERE sha256 = ?", [(sha256,) for sha256 in gone])
        if gone:
            self._remove_unnamed_files(gone)
        return len(gone)

    def size_bytes(self, person: str | None = None) -> int:
        """Return the size of all files that jobs have written and people have sent [bytes]; of one person or of all."""
        sent, written = "SELECT sha256, size FROM uploads", "SELECT sha256, size FROM outputs"
        values: tuple[str, ...] = ()
        if person is not None:
            written = f"{written} JOIN jobs ON jobs.id = job WHERE jobs.person = ?"
            sent, values = f"{sent} WHERE person = ?", (person, person)
        return int(self._db.read(f"SELECT sum(size) FROM ({written} UNION {sent})", *values)[0][0] or 0)

    def _list_ended_jobs(self, moment: float, tasks: bool = False) -> list[str]:
        """Return the jobs that ended before a moment [s since 1970] and are not archived, the oldest first."""
        query = "SELECT id FROM jobs WHERE task = ? AND finished < ? AND archived = 0 ORDER BY finished, id"
        return [row["id"] for row in self._db.read(query, int(tasks), moment)]

    def _try_delete(self, id: str, before: float) -> bool:
        """Delete a job that ended before a moment [s since 1970], unless it is needed or was put aside meanwhile."""

        def check(job: JobRecord) -> None:
            """Refuse what somebody has archived, or asked for anew, since the list was made."""
            if job.archived or (job.finished or before) >= before:
                raise KeptJobError("it is to be kept")

        try:
            self.delete(id, check)
        except InputError:  # it is needed, or went with another
            return False
        return True


def _reason_to_keep(db: sqlite3.Connection, job: JobRecord, named_by: Sequence[sqlite3.Row]) -> str:
    """Return why a job cannot be deleted: it runs, a record cites it, or other jobs name it; empty where it can be."""
    if not job.ended:
        return f"it is {job.state}; cancel it first"
    cited = "SELECT serial FROM outputs JOIN recorded ON document_sha256 = sha256 WHERE job = ? LIMIT 1"
    row = db.execute(cited, (job.id,)).fetchone()
    if row is not None:
        return f"the record of the robot {row['serial']} cites it"
    row = db.execute("SELECT serial FROM cell_sessions WHERE plan = ? AND serial != '' LIMIT 1", (job.id,)).fetchone()
    if row is not None:
        return f"the robot {row['serial']} was measured by it"
    for other in named_by:
        if not other["task"]:
            return f"the {other['kind']} {other['id']} starts from it; delete that first"
        if other["state"] in ("queued", "running"):
            return "a page is being made of it; try again in a moment"
    return ""


def _jobs_naming(db: sqlite3.Connection, id: str) -> list[sqlite3.Row]:
    """Return the jobs whose requests name a job: all requests are looked through."""
    query = "SELECT id, kind, state, task FROM jobs WHERE id != ? AND instr(request, ?) > 0"
    return db.execute(query, (id, id)).fetchall()


def _contents(db: sqlite3.Connection, id: str) -> list[str]:
    """Return the hashes of the files that a job has written or was given."""
    query = "SELECT sha256 FROM outputs WHERE job = ? UNION SELECT sha256 FROM inputs WHERE job = ?"
    return [row["sha256"] for row in db.execute(query, (id, id))]


class Sweeper:
    """The thread that sweeps now and then, where anything is to go."""

    def __init__(self, keeper: JobKeeper, kept: Retention) -> None:
        self._keeper, self._kept, self._stopping = keeper, kept, threading.Event()
        self._thread = threading.Thread(target=self._run, name="sweeper", daemon=True)

    def start(self) -> None:
        """Begin, where anything is to go."""
        if self._kept.limited:
            self._thread.start()

    def stop(self) -> None:
        """Stop sweeping, and wait for the thread to end."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        sweep_s = 3_600.0  # between two sweeps: what may go is days old
        while not self._stopping.is_set():
            try:
                count = self._keeper.sweep(self._kept, time.time())
                self._keeper.remove_old_uploads(time.time() - DAY_S)
            except Exception:
                LOG.exception("old jobs could not be swept")
            else:
                if count:
                    LOG.info("%d old jobs deleted", count)
            self._stopping.wait(sweep_s)
