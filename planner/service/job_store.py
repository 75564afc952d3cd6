"""Jobs and their events: accepted once, owned by one server at a time, ended by the owner of the latest fence alone."""

import json
import sqlite3
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import fields
from typing import Literal

from pydantic import TypeAdapter

from planner import __version__
from planner.common.errors import InputError
from planner.service.database import NAMING, Database
from planner.service.job_queue import Foresight, Outlook, foresee_ends, next_job
from planner.service.job_record import (
    SERIALS,
    JobCommand,
    JobEvent,
    JobFilter,
    JobOutput,
    JobPlace,
    JobProblem,
    JobRecord,
    State,
)
from planner.service.owner import is_gone, own_name


class UnknownJobError(InputError):
    """A job that somebody names is not there."""


LEASE_S = 20.0  # [s] that a job is a server's after it was last heard of
MOST_CRASHES = 3  # of a command, after which it is the job's fault
MOST_DEATHS = 20  # of servers while they ran a job: a machine that is switched off often is no fault of the job's


COMMAND, PROBLEM = TypeAdapter(JobCommand), TypeAdapter(JobProblem)
JobCheck = Callable[["JobRecord"], None]  # raises what forbids to change a job


class JobStore:
    """All jobs of a database."""

    def __init__(self, database: Database) -> None:
        self._db, self._owner = database, own_name()
        self._leases: dict[str, tuple[float, float]] = {}  # of each running job: its lease, and since when it is that
        self._foreseen = Foresight(0.0, {})

    def at_one_moment(self) -> AbstractContextManager[object]:
        """What is read meanwhile agrees, whatever others write; nothing can be written by who reads."""
        return self._db.snapshot()

    def submit(
        self,
        id: str,
        kind: str,
        title: str,
        request: str,
        command: JobCommand,
        robot: str = "",
        person: str = "",
        check_inputs: bool = False,
    ) -> JobRecord:
        """Accept a job, or return the one of the same content; one that was cancelled or crashed is tried again.

        ``robot``: the model of robot that it is of, where that is known; ``person``: who asks for it.

        Raises:
            UnknownJobError: a file that it starts from went meanwhile, with the job that had written it
                (``check_inputs``).
        """
        with self._db.write() as db:
            found, words = self._find(id), COMMAND.dump_json(command).decode()
            if found is None:
                if check_inputs and not all(is_named(db, i.sha256) for i in command.inputs):
                    raise UnknownJobError("what it starts from was deleted meanwhile")
                db.execute(
                    "INSERT INTO jobs (id, kind, title, request, command, task, robot, person, state, created, version)"
                    " VALUES (?, ?, ?, ?, ?, ?, ?, ?, 'queued', ?, ?)",
                    (id, kind, title, request, words, command.task, robot, person, time.time(), __version__),
                )
                db.executemany("INSERT INTO inputs VALUES (?, ?)", [(id, i.sha256) for i in command.inputs])
                _tell(db, id, "queued", {})
            elif found.state == "running" and found.cancelled:  # not stopped yet: it may go on
                db.execute("UPDATE jobs SET cancelled = 0, person = ? WHERE id = ?", (person, id))
            elif found.is_tried_again:
                if found.state == "cancelled":  # who had asked for it wanted it no more
                    db.execute("DELETE FROM askers WHERE job = ?", (id,))
                db.execute(
                    "UPDATE jobs SET state = 'queued', crashes = 0, deaths = 0, cancelled = 0, problem = '',"
                    " exit_code = NULL, finished = NULL, stage = '', done = 0, total = 0, person = ? WHERE id = ?",
                    (person, id),
                )
                db.execute("DELETE FROM outputs WHERE job = ?", (id,))
                db.execute("DELETE FROM events WHERE job = ?", (id,))  # who follows it must not meet the earlier end
                _tell(db, id, "queued", {})
            db.execute("INSERT OR IGNORE INTO askers VALUES (?, ?)", (id, person))
            return self.get(id)

    def get(self, id: str) -> JobRecord:
        """Return a job.

        Raises:
            UnknownJobError: there is none.
        """
        found = self._find(id)
        if found is None:
            raise UnknownJobError(f"there is no job {id}")
        return found

    def list_jobs(self, wanted: JobFilter, most: int = 200, after: JobPlace | None = None) -> list[JobRecord]:
        """Return the latest jobs that are wanted, those before a place in the list where one is given."""
        where, values = wanted.condition()
        if after is not None:
            where, values = f"{where} AND (created, id) < (?, ?)", (*values, after.created, after.id)
        query = f"SELECT * FROM jobs WHERE {where} ORDER BY created DESC, id DESC LIMIT ?"
        return [_record(r) for r in self._db.read(query, *values, most)]

    def take(self, most: int, beside: int = 1) -> JobRecord | None:
        """Make the next waiting job this server's, under a new fence; nothing where ``most`` are running.

        People take turns (:mod:`planner.service.job_queue`). The short tasks of a page, at which a person looks, go
        before commands, and ``beside`` may run beside ``most``.
        A job whose server is gone, or has not renewed its lease, waits again.
        """
        with self._db.write() as db:
            now, running = time.time(), len(self._release_lost_jobs(db))
            chosen = next_job(db, now) if running < most + beside else None
            if chosen is None or running >= most + beside * chosen[1]:
                return None
            id = chosen[0]
            db.execute(
                "UPDATE jobs SET state = 'running', fence = fence + 1, owner = ?, lease_until = ?, started = ?,"
                " stage = 'starting', done = 0, total = 0, version = ? WHERE id = ?",
                (self._owner, now + LEASE_S, now, __version__, id),
            )
            _tell(db, id, "running", {})
            return self.get(id)  # before anybody else may take it under a later fence

    def outlook(self, id: str, workers: int) -> Outlook | None:
        """Return when a job is to be done where so many run at a time; nothing of one that has ended."""
        with self._db.snapshot() as db:  # else a job may begin between two of its questions
            row = db.execute("SELECT state, task FROM jobs WHERE id = ?", (id,)).fetchone()
            if row is None or row["task"] or row["state"] not in ("queued", "running"):
                return None
            found = self._foreseen.find(id, row["state"], time.monotonic())
            if found is None:
                outlooks = foresee_ends(db, workers, time.time())
                self._foreseen, found = Foresight(time.monotonic(), outlooks), outlooks[id]
            return found

    def running_jobs(self) -> set[str]:
        """Return identifier and fence of every job that a living server runs, as ``id-fence``; others wait again."""
        with self._db.write() as db:
            return self._release_lost_jobs(db)

    def renew(self, job: JobRecord) -> bool:
        """Renew the lease; return whether the job is still this fence's and nobody wants it stopped."""
        with self._db.write() as db:
            return _update(db, job, "lease_until = ?", time.time() + LEASE_S)

    def wants_stop(self, job: JobRecord) -> bool:
        """Tell whether the job was cancelled, or is another fence's."""
        now = self._find(job.id)
        return now is None or now.cancelled or now.fence != job.fence or now.state != "running"

    def progress(self, job: JobRecord, stage: str, done: int, total: int) -> None:
        """Say how far a job is; only where that is news."""
        with self._db.write() as db:
            known = db.execute("SELECT stage, done FROM jobs WHERE id = ?", (job.id,)).fetchone()
            news, lease = known is not None and tuple(known) != (stage, done), time.time() + LEASE_S
            if news and _update(db, job, "stage = ?, done = ?, total = ?, lease_until = ?", stage, done, total, lease):
                _tell(db, job.id, "progress", {"stage": stage, "done": done, "of": total})

    def finish(
        self, job: JobRecord, state: State, outputs: list[JobOutput], exit_code: int | None, problem: JobProblem | None
    ) -> bool:
        """End a job with all its files in one step; nothing happens where the fence is no longer this one's.

        One that was stopped waits again where somebody has asked for it anew before it stood.
        """
        with self._db.write() as db:
            if state == "cancelled" and not self.wants_stop(job):
                return _wait_again(db, job, 0, "somebody asked for it again")
            ended = (state, time.time(), exit_code, _problem_text(problem))
            if not _update(db, job, "state = ?, finished = ?, exit_code = ?, problem = ?, lease_until = 0", *ended):
                return False
            db.executemany(
                "INSERT INTO outputs VALUES (?, ?, ?, ?)", [(job.id, o.name, o.sha256, o.size) for o in outputs]
            )
            db.execute(
                "DELETE FROM events WHERE job = ? AND kind = 'progress' AND content NOT LIKE '%\"done\":0,%'", (job.id,)
            )
            _tell(db, job.id, "end", {"state": state, "detail": problem.detail if problem else ""})
        return True

    def requeue(self, job: JobRecord, crashed: bool) -> None:
        """Let a job wait again: its process was killed from outside, or this server stops."""
        with self._db.write() as db:
            _wait_again(db, job, int(crashed), "its process was killed" if crashed else "the server stopped")

    def askers(self, id: str) -> set[str]:
        """Return who has asked for a job, and still wants it."""
        return {row["person"] for row in self._db.read("SELECT person FROM askers WHERE job = ?", id)}

    def leave(self, id: str, person: str) -> bool:
        """Let a person want a job no more; tell whether others still do, whose it is then."""
        with self._db.write() as db:
            others = self.askers(id) - {person}
            if person not in self.askers(id) or not others:
                return False
            db.execute("DELETE FROM askers WHERE job = ? AND person = ?", (id, person))
            db.execute("UPDATE jobs SET person = ? WHERE id = ? AND person = ?", (min(others), id, person))
            return True

    def cancel(self, id: str, check: JobCheck = lambda job: None) -> JobRecord:
        """Ask for a job to be stopped; a job that still waits is cancelled at once.

        ``check`` raises what forbids it, of the job as it is at that moment.

        Raises:
            UnknownJobError: there is none.
        """
        with self._db.write() as db:
            check(self.get(id))
            waiting = db.execute(
                "UPDATE jobs SET state = 'cancelled', finished = ? WHERE id = ? AND state = 'queued'", (time.time(), id)
            )
            if waiting.rowcount:
                _tell(db, id, "end", {"state": "cancelled", "detail": ""})
            db.execute("UPDATE jobs SET cancelled = 1 WHERE id = ? AND state = 'running'", (id,))
            return self.get(id)

    def outputs(self, id: str) -> list[JobOutput]:
        """Return the files of a job that has ended."""
        return self.outputs_of([id])[id]

    def jobs_with(self, table: Literal["inputs", "outputs"], sha256: str, kind: str) -> list[JobRecord]:
        """Return the finished jobs of a kind that were given, or have written, a file of this content; latest last."""
        query = f"SELECT DISTINCT jobs.* FROM {table} JOIN jobs ON jobs.id = job WHERE sha256 = ? AND kind = ?"
        return [_record(r) for r in self._db.read(f"{query} AND state = 'done' ORDER BY finished, id", sha256, kind)]

    def writer(self, sha256: str, kind: str) -> JobRecord | None:
        """Return the latest job of a kind that has written a file of this content."""
        return next(iter(self.jobs_with("outputs", sha256, kind)[::-1]), None)

    def outputs_of(self, ids: Sequence[str]) -> dict[str, list[JobOutput]]:
        """Return the files of some jobs that have ended, by their identifiers."""
        found: dict[str, list[JobOutput]] = {id: [] for id in ids}
        query = f"SELECT job, name, sha256, size FROM outputs WHERE job IN ({_marks(ids)}) ORDER BY job, name"
        for job, *output in self._db.read(query, *ids):
            found[job].append(JobOutput(*output))
        return found

    def serials_of(self, ids: Sequence[str]) -> dict[str, str]:
        """Return the serial numbers of the robots that jobs are of, where one is known."""
        rows = self._db.read(
            f"SELECT job, max(serial) FROM ({SERIALS}) WHERE job IN ({_marks(ids)}) GROUP BY job", *ids
        )
        return {job: serial for job, serial in rows}

    def people_of(self, ids: Sequence[str]) -> dict[str, list[str]]:
        """Return who has asked for each of some jobs, by name."""
        query = f"SELECT job, person FROM askers WHERE job IN ({_marks(ids)}) AND person != '' ORDER BY job, person"
        found: dict[str, list[str]] = {}
        for job, person in self._db.read(query, *ids):
            found.setdefault(job, []).append(person)
        return found

    def jobs_by_output(self, documents: Sequence[str]) -> dict[str, str]:
        """Return which job has written each of some documents, by their SHA-256."""
        query = f"SELECT sha256, job FROM outputs WHERE sha256 IN ({_marks(documents)})"
        return {sha256: job for sha256, job in self._db.read(query, *documents)}

    def events_after(self, number: int, jobs: list[str], most: int = 500) -> list[JobEvent]:
        """Return what happened to some jobs (to all, where none is named) after the event of this number."""
        where = f"AND job IN ({_marks(jobs)})" if jobs else ""
        query = f"SELECT id, job, kind, content, at FROM events WHERE id > ? {where} ORDER BY id LIMIT ?"
        return [JobEvent(*r) for r in self._db.read(query, number, *jobs, most)]

    def count_open_states(self) -> tuple[int, int]:
        """Return how many jobs run, and how many wait, at one moment."""
        query = "SELECT ifnull(sum(state = 'running'), 0), ifnull(sum(state = 'queued'), 0) FROM jobs"
        ((running, waiting),) = self._db.read(f"{query} WHERE state IN ('running', 'queued')")
        return int(running), int(waiting)

    def is_accepted(self, id: str) -> bool:
        """Tell whether a job is there that asking for it again does not start anew."""
        found = self._find(id)
        return found is not None and not found.is_tried_again

    def count_open(self, person: str) -> int:
        """Return how many jobs of a person wait or run, without the short tasks of pages."""
        query = "SELECT count(*) FROM jobs WHERE state IN ('queued', 'running') AND person = ? AND task = 0"
        return int(self._db.read(query, person)[0][0])

    def list_people(self) -> list[str]:
        """Return the names of all who have jobs."""
        return [row[0] for row in self._db.read("SELECT DISTINCT person FROM jobs WHERE person != '' ORDER BY person")]

    def statistics(self) -> list[tuple[str, str, int]]:
        """Return the number of jobs of each kind and state."""
        return [tuple(row) for row in self._db.read("SELECT kind, state, count(*) FROM jobs GROUP BY kind, state")]

    def durations(self) -> list[tuple[str, int, float]]:
        """Return of each kind how many jobs were done, and how long they ran together [s]."""
        query = "SELECT kind, count(*), sum(finished - started) FROM jobs WHERE state = 'done' GROUP BY kind"
        return [(kind, count, float(total or 0.0)) for kind, count, total in self._db.read(query)]

    def waiting_s(self) -> float:
        """Return the age of the oldest job that waits [s], 0 where none does."""
        first = self._db.read("SELECT min(created) FROM jobs WHERE state = 'queued'")[0][0]
        return 0.0 if first is None else max(0.0, time.time() - float(first))

    def last_event(self) -> int:
        """Return the number of the latest event."""
        return int(self._db.read("SELECT ifnull(max(id), 0) FROM events")[0][0])

    def _release_lost_jobs(self, db: sqlite3.Connection) -> set[str]:
        """Let the jobs of servers that are gone, or do not renew their lease, wait again; return those that run.

        A lease has run out when it has not changed for its length by this process's own steady clock: the time of day
        may be set forward or back while jobs run.
        """
        kept, now, leases = set(), time.monotonic(), self._leases
        self._leases = {}
        query = "SELECT id, fence, owner, lease_until, deaths FROM jobs WHERE state = 'running'"
        for row in db.execute(query).fetchall():
            key = f"{row['id']}-{row['fence']}"
            lease, since = leases.get(key, (None, now))
            since = since if lease == row["lease_until"] else now
            if row["lease_until"] > 0 and now - since < LEASE_S and not is_gone(row["owner"]):
                self._leases[key] = (row["lease_until"], since)
                kept.add(key)
            else:
                _count_death(db, row["id"], row["deaths"] + 1)
        return kept

    def _find(self, id: str) -> JobRecord | None:
        rows = self._db.read("SELECT * FROM jobs WHERE id = ?", id)
        return _record(rows[0]) if rows else None


def _record(r: sqlite3.Row) -> JobRecord:
    parsed = {name: bool(r[name]) for name in ("cancelled", "archived")} | {
        "command": COMMAND.validate_json(r["command"]),
        "problem": PROBLEM.validate_json(r["problem"]) if r["problem"] else None,
    }
    return JobRecord(**{f.name: r[f.name] for f in fields(JobRecord)} | parsed)


def _marks(values: Sequence[str]) -> str:
    """Return a place of a query for each value."""
    return ", ".join("?" * len(values))


def _problem_text(problem: JobProblem | None) -> str:
    return PROBLEM.dump_json(problem).decode() if problem else ""


def is_named(db: sqlite3.Connection, sha256: str) -> bool:
    """Tell whether a job or an upload names a file of the store: one that nothing names may go."""
    named = "SELECT 1 FROM {} WHERE sha256 = ? LIMIT 1"
    return any(db.execute(named.format(table), (sha256,)).fetchone() for table in NAMING)


def _wait_again(db: sqlite3.Connection, job: JobRecord, crashes: int, because: str) -> bool:
    """Let a job of this fence wait again; return whether it was still this fence's."""
    waits = "state = 'queued', stage = '', crashes = crashes + ?, lease_until = 0"
    done = _update(db, job, waits, crashes)
    if done:
        _tell(db, job.id, "queued", {"because": because})
    return done


def _update(db: sqlite3.Connection, job: JobRecord, change: str, *values: object) -> bool:
    """Change a job, and return whether it was changed: only what this fence still runs is."""
    query = f"UPDATE jobs SET {change} WHERE id = ? AND fence = ? AND state = 'running'"
    return db.execute(query, (*values, job.id, job.fence)).rowcount == 1


def _tell(db: sqlite3.Connection, job: str, kind: str, content: dict[str, object]) -> None:
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"))
    db.execute("INSERT INTO events (job, kind, content, at) VALUES (?, ?, ?, ?)", (job, kind, text, time.time()))


def _count_death(db: sqlite3.Connection, job: str, deaths: int) -> None:
    """Let a job whose server has gone wait again, or give it up where too many servers went while it ran."""
    if deaths < MOST_DEATHS:
        db.execute("UPDATE jobs SET state = 'queued', stage = '', deaths = ? WHERE id = ?", (deaths, job))
        _tell(db, job, "queued", {"because": "the server that ran it has stopped"})
        return
    detail = f"the server was killed or broke down {deaths} times while it ran; it may need more than this machine has"
    problem = JobProblem("The server went while it ran", detail)
    given_up = "state = 'failed', stage = '', deaths = ?, finished = ?, exit_code = NULL, problem = ?"
    db.execute(f"UPDATE jobs SET {given_up} WHERE id = ?", (deaths, time.time(), _problem_text(problem), job))
    _tell(db, job, "end", {"state": "failed", "detail": detail})
