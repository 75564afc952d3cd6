"""The embedded database: SQLite in WAL mode, every commit on the disk before it is answered."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from planner.common.errors import InputError

FIRST = """
CREATE TABLE jobs (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, title TEXT NOT NULL, request TEXT NOT NULL, command TEXT NOT NULL,
    state TEXT NOT NULL, fence INTEGER NOT NULL DEFAULT 0, owner TEXT NOT NULL DEFAULT '',
    lease_until REAL NOT NULL DEFAULT 0, crashes INTEGER NOT NULL DEFAULT 0, cancelled INTEGER NOT NULL DEFAULT 0,
    stage TEXT NOT NULL DEFAULT '', done INTEGER NOT NULL DEFAULT 0, total INTEGER NOT NULL DEFAULT 0,
    created REAL NOT NULL, started REAL, finished REAL, exit_code INTEGER, problem TEXT NOT NULL DEFAULT '',
    version TEXT NOT NULL DEFAULT '');
CREATE INDEX jobs_by_state ON jobs (state, created);
CREATE TABLE events (
    id INTEGER PRIMARY KEY AUTOINCREMENT, job TEXT NOT NULL REFERENCES jobs (id), kind TEXT NOT NULL,
    content TEXT NOT NULL, at REAL NOT NULL);
CREATE INDEX events_by_job ON events (job, id);
CREATE TABLE outputs (
    job TEXT NOT NULL REFERENCES jobs (id), name TEXT NOT NULL, sha256 TEXT NOT NULL, size INTEGER NOT NULL,
    PRIMARY KEY (job, name));
CREATE TABLE uploads (
    sha256 TEXT NOT NULL, name TEXT NOT NULL, size INTEGER NOT NULL, kind TEXT NOT NULL, at REAL NOT NULL,
    PRIMARY KEY (sha256, name, kind));
"""
DEATHS = "ALTER TABLE jobs ADD COLUMN deaths INTEGER NOT NULL DEFAULT 0;"  # of servers while they ran the job
LISTS = """
ALTER TABLE jobs ADD COLUMN task INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN robot TEXT NOT NULL DEFAULT '';
UPDATE jobs SET task = ifnull(json_extract(command, '$.task'), 0);
UPDATE jobs SET robot = substr(title, 1, instr(title, '/') - 1)
    WHERE kind IN ('plan', 'study') AND instr(title, '/') > 1;
CREATE INDEX jobs_by_time ON jobs (task, created, id);
CREATE INDEX jobs_by_kind ON jobs (kind, created, id);
CREATE INDEX outputs_by_content ON outputs (sha256);
CREATE TABLE robots (
    serial TEXT PRIMARY KEY, robot TEXT NOT NULL, state TEXT NOT NULL, advice TEXT NOT NULL, due TEXT,
    due_text TEXT NOT NULL, entries INTEGER NOT NULL, simulated INTEGER NOT NULL, stamp TEXT NOT NULL);
CREATE TABLE recorded (
    serial TEXT NOT NULL REFERENCES robots (serial) ON DELETE CASCADE, place INTEGER NOT NULL,
    document_sha256 TEXT NOT NULL, circumstances TEXT NOT NULL, PRIMARY KEY (serial, place));
CREATE INDEX recorded_by_content ON recorded (document_sha256);
"""
KEEPING = """
ALTER TABLE jobs ADD COLUMN note TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN archived INTEGER NOT NULL DEFAULT 0;
CREATE TABLE inputs (job TEXT NOT NULL REFERENCES jobs (id), sha256 TEXT NOT NULL);
CREATE INDEX inputs_by_job ON inputs (job);
CREATE INDEX inputs_by_content ON inputs (sha256);
INSERT INTO inputs SELECT jobs.id, json_extract(value, '$.sha256') FROM jobs, json_each(jobs.command, '$.inputs');
"""
PEOPLE = """
CREATE TABLE people (name TEXT PRIMARY KEY, role TEXT NOT NULL, password TEXT NOT NULL, created REAL NOT NULL);
CREATE TABLE tokens (
    sha256 TEXT PRIMARY KEY, person TEXT NOT NULL, label TEXT NOT NULL, created REAL NOT NULL);
CREATE TABLE sessions (sha256 TEXT PRIMARY KEY, person TEXT NOT NULL, opened REAL NOT NULL, seen REAL NOT NULL);
CREATE TABLE deeds (
    id INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, person TEXT NOT NULL, address TEXT NOT NULL,
    deed TEXT NOT NULL, subject TEXT NOT NULL, status INTEGER NOT NULL);
CREATE INDEX deeds_by_person ON deeds (person, id);
ALTER TABLE jobs ADD COLUMN person TEXT NOT NULL DEFAULT '';
ALTER TABLE uploads ADD COLUMN person TEXT NOT NULL DEFAULT '';
CREATE INDEX jobs_by_person ON jobs (person, created, id);
"""
TICKS = """
CREATE TABLE ticks (
    job TEXT NOT NULL REFERENCES jobs (id), step TEXT NOT NULL, done INTEGER NOT NULL, at REAL NOT NULL,
    person TEXT NOT NULL, PRIMARY KEY (job, step));
"""
NOTICES = "CREATE TABLE notices (url TEXT PRIMARY KEY, last INTEGER NOT NULL);"
CELL_NOTES = "CREATE TABLE cell_notes (sha256 TEXT PRIMARY KEY, title TEXT NOT NULL, note TEXT NOT NULL);"
RECORDS = """
ALTER TABLE recorded ADD COLUMN withdrawn INTEGER NOT NULL DEFAULT 0;
ALTER TABLE recorded ADD COLUMN number INTEGER NOT NULL DEFAULT 0;
ALTER TABLE recorded ADD COLUMN kind TEXT NOT NULL DEFAULT '';
DELETE FROM recorded;
DELETE FROM robots;
CREATE TABLE askers (job TEXT NOT NULL REFERENCES jobs (id), person TEXT NOT NULL, PRIMARY KEY (job, person));
INSERT INTO askers SELECT id, person FROM jobs;
CREATE INDEX askers_by_person ON askers (person);
CREATE TABLE cell_sessions (
    id TEXT PRIMARY KEY, plan TEXT NOT NULL REFERENCES jobs (id), serial TEXT NOT NULL, begun REAL NOT NULL,
    person TEXT NOT NULL, ended REAL);
CREATE INDEX cell_sessions_by_serial ON cell_sessions (serial, begun);
CREATE INDEX cell_sessions_by_plan ON cell_sessions (plan);
CREATE TABLE session_ticks (
    session TEXT NOT NULL REFERENCES cell_sessions (id), step TEXT NOT NULL, done INTEGER NOT NULL, at REAL NOT NULL,
    person TEXT NOT NULL, PRIMARY KEY (session, step));
INSERT INTO cell_sessions SELECT job, job, '', min(at), '', NULL FROM ticks GROUP BY job;
INSERT INTO session_ticks SELECT job, step, done, at, person FROM ticks;
DROP TABLE ticks;
"""  # the index of records is read anew
NO_MAPS = "".join(
    f"DELETE FROM {table} WHERE job IN (SELECT id FROM jobs WHERE kind = 'error-map');"
    for table in ("events", "outputs", "inputs", "askers")
)  # the page of a calibration has the map of its report
NO_MAPS += "DELETE FROM jobs WHERE kind = 'error-map';"
MIGRATIONS = (FIRST, DEATHS, LISTS, KEEPING, PEOPLE, TICKS, NOTICES, CELL_NOTES, RECORDS, NO_MAPS)
"""Statements that lead from one version of the store to the next; the version is how many of them it has seen."""
VERSION = len(MIGRATIONS)
NAMING = ("outputs", "inputs", "uploads")  # tables that name files of the store: what stands in none of them may go
NAMED = " UNION ".join(f"SELECT sha256 FROM {table}" for table in NAMING)


def damage_text(err: sqlite3.Error) -> str:
    """Return the message for a database whose pages are damaged."""
    return f"the store of jobs is damaged ({err}); end the service and bring back a backup of its folder"


def is_damage(err: BaseException) -> bool:
    """Tell whether an error means that the file is no store any more, and not that it is busy or the disk full."""
    return type(err) is sqlite3.DatabaseError


class Database:
    """One file, one connection a thread."""

    def __init__(self, path: Path) -> None:
        """Open the database at ``path``, or make it.

        Raises:
            InputError: the file cannot be used, or a later version of the planner has written it.
        """
        self._path, self._local = path, threading.local()
        try:
            with self.write() as db:
                found = int(db.execute("PRAGMA user_version").fetchone()[0])
                for step in MIGRATIONS[found:]:
                    for statement in step.split(";"):
                        db.execute(statement)
                db.execute(f"PRAGMA user_version = {max(found, VERSION)}")
        except sqlite3.Error as err:
            if is_damage(err):
                raise InputError(f"{path}: {damage_text(err)}") from err
            raise InputError(f"{path}: cannot be used as the store of jobs ({err})") from err
        if found > VERSION:
            raise InputError(f"{path}: was written by a later version of edbb (store {found}, known is {VERSION})")

    @property
    def connection(self) -> sqlite3.Connection:
        """This thread's connection; reads need no more."""
        made: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if made is None:
            made = sqlite3.connect(self._path, isolation_level=None, timeout=30)
            made.row_factory = sqlite3.Row
            made.execute("PRAGMA journal_mode = WAL")
            made.execute("PRAGMA synchronous = FULL")
            made.execute("PRAGMA foreign_keys = ON")
            self._local.connection = made
        return made

    def read(self, query: str, *values: object) -> list[sqlite3.Row]:
        """Return the rows that a query finds."""
        return self.connection.execute(query, values).fetchall()

    @contextmanager
    def snapshot(self) -> Iterator[sqlite3.Connection]:
        """Reads that agree with one another: what others write meanwhile is not seen.

        Within another one, or within a transaction that writes, it is part of that.
        """
        db = self.connection
        if db.in_transaction:
            yield db
            return
        db.execute("BEGIN DEFERRED")
        try:
            yield db
        finally:
            db.execute("ROLLBACK")  # nothing was written

    @property
    def is_within_transaction(self) -> bool:
        """Whether this thread is reading at one moment, or writing."""
        return self.connection.in_transaction

    @contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """One transaction, alone among all writers; an error undoes all of it."""
        db = self.connection
        db.execute("BEGIN IMMEDIATE")
        try:
            yield db
        except BaseException:
            db.execute("ROLLBACK")
            raise
        db.execute("COMMIT")
