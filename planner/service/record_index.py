"""What the lists say of every record, kept in the database: no page reads all folders.

A folder is read again only where its stamp has changed, so that what ``edbb record`` adds there is seen too.
"""

import json
import re
import sqlite3
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Literal

from pydantic import Field

from planner.checks.record import Circumstances, RobotRecord
from planner.common.errors import InputError
from planner.common.schema import StrictModel
from planner.common.system import hold_lock
from planner.service.database import Database

RobotState = Literal["good", "check due", "changed", "not calibrated", "never measured", "withdrawn", "damaged"]
IN_NEED = ("damaged", "changed", "check due", "not calibrated", "never measured", "good", "withdrawn")  # as listed
LOOK_S = 2.0  # between two looks at the stamps of all folders
ADVICE = {"good": "nothing until the next check", "check due": "measure the poses of a check", "withdrawn": "nothing"}
UNRECORDED = "add its failed check to the record"
IS_CHANGED = "serial IN (SELECT value FROM json_each(:changed))"
ROBOT_ADVICE = f"CASE WHEN {IS_CHANGED} THEN '{UNRECORDED}' ELSE advice END AS advice"
COLUMNS = f"serial, robot, {ROBOT_ADVICE}, due, due_text, entries, simulated"
STATE = f"CASE WHEN {IS_CHANGED} THEN 'changed' WHEN state = 'good' AND due < :today THEN 'check due' ELSE state END"


class RecordSummary(StrictModel):
    """A robot and how it stands today."""

    serial: str
    robot: str
    state: RobotState
    advice: str
    next_check: date | None = Field(description="after a failed check its own day: it is due at once")
    due: str = Field(description="the same in words", examples=["now: master axis 3 and check again"])
    entries: int
    simulated: bool = Field(description="nobody has measured this robot: there is none")

    @property
    def place(self) -> str:
        """Place in the list, for the page behind it."""
        return f"{IN_NEED.index(self.state)}~{self.next_check or ''}~{self.serial}"


@dataclass(frozen=True)
class RecordedEntry:
    """What the record of a robot says of a result that was added to it; empty where it is in none."""

    serial: str = ""
    number: int = 0
    kind: str = ""
    circumstances: Circumstances | None = None
    simulated: bool = False

    def field(self, name: str) -> str:
        """Return one of the circumstances as text."""
        value = None if self.circumstances is None else getattr(self.circumstances, name)
        return "" if value is None else str(value)


@dataclass(frozen=True)
class RobotFilter:
    """What is wanted of robots: ``text`` stands in serial number or model; nothing where all are."""

    text: str = ""
    robot: str | None = None
    state: RobotState | None = None
    simulated: bool | None = None


class RecordIndex:
    """The index of a folder of records."""

    def __init__(self, folder: Path, database: Database) -> None:
        self._folder, self._db = folder, database
        self._looking, self._looked = threading.Lock(), 0.0

    def list_robots(
        self, wanted: RobotFilter, most: int, after: str = "", changed: Collection[str] = ()
    ) -> list[RecordSummary]:
        """Return robots, those in need first, then by the day of their next check; behind a place where one is given.

        ``changed``: serial numbers of robots that have changed by a check that is in no record yet.

        Raises:
            InputError: ``after`` is no place that a robot has (:attr:`RecordSummary.place`).
        """
        self.refresh()
        rank = " ".join(f"WHEN '{state}' THEN {k}" for k, state in enumerate(IN_NEED))
        query = (
            f"SELECT * FROM (SELECT *, CASE state {rank} END AS rank, ifnull(due, '') AS day"
            f" FROM (SELECT {COLUMNS}, {STATE} AS state FROM robots))"
            " WHERE instr(lower(serial || ' ' || robot), :text) > 0 AND robot = ifnull(:robot, robot)"
            " AND (state != 'withdrawn' OR :text != '' OR :state = state)"
            " AND state = ifnull(:state, state) AND simulated = ifnull(:simulated, simulated)"
            " AND (rank, day, serial) > (:rank, :day, :serial) ORDER BY rank, day, serial LIMIT :most"
        )
        values = {
            "today": date.today().isoformat(), "text": wanted.text.lower(), "robot": wanted.robot,
            "state": wanted.state, "simulated": wanted.simulated, "most": most, "changed": json.dumps([*changed]),
            **_parse_place(after),
        }  # fmt: skip
        return [_summary(row) for row in self._db.connection.execute(query, values).fetchall()]

    def count(self) -> int:
        """Return the number of robots that have a record."""
        return int(self._db.read("SELECT count(*) FROM robots")[0][0])

    def count_states(self, changed: Collection[str] = ()) -> dict[str, int]:
        """Return how many robots are in each state today; ``changed`` as of :meth:`list_robots`."""
        self.refresh()
        query = f"SELECT {STATE} AS now, count(*) FROM robots GROUP BY now"
        values = {"today": date.today().isoformat(), "changed": json.dumps([*changed])}
        found = dict(self._db.connection.execute(query, values).fetchall())
        return {state: int(found.get(state, 0)) for state in IN_NEED}

    def find_entry(self, documents: set[str]) -> RecordedEntry:
        """Return the latest entry that counts and whose document has one of these SHA-256."""
        self.refresh()
        marks = ", ".join("?" * len(documents))
        rows = self._db.read(
            "SELECT serial, number, kind, circumstances, simulated FROM recorded JOIN robots USING (serial)"
            f" WHERE document_sha256 IN ({marks}) AND withdrawn = 0 ORDER BY serial DESC, place DESC LIMIT 1",
            *documents,
        )
        if not rows:
            return RecordedEntry()
        serial, number, kind, circumstances, simulated = rows[0]
        said = Circumstances.model_validate_json(circumstances)
        return RecordedEntry(serial, number, kind, said, bool(simulated))

    def last_calibration(self, serial: str) -> int:
        """Return the number of the latest entry of a robot that is a calibration and counts; 0 where none does."""
        query = "SELECT number FROM recorded WHERE serial = ? AND kind = 'calibration' AND withdrawn = 0"
        rows = self._db.read(f"{query} ORDER BY place DESC LIMIT 1", serial)
        return int(rows[0][0]) if rows else 0

    def unrecorded_checks(self) -> list[str]:
        """Return the finished checks that are in no record."""
        query = (
            "SELECT job FROM outputs JOIN jobs ON jobs.id = job WHERE kind = 'check' AND state = 'done'"
            " AND name = 'check.json' AND sha256 NOT IN (SELECT document_sha256 FROM recorded)"
        )
        return [row[0] for row in self._db.read(query)]

    def is_withdrawn(self, document: str) -> bool:
        """Tell whether a document was in a record and counts in none."""
        rows = self._db.read("SELECT min(withdrawn) FROM recorded WHERE document_sha256 = ?", document)
        return bool(rows[0][0] == 1)

    def read(self, serial: str) -> None:
        """Read a record to which something was added."""
        self._keep(serial, _stamp(self._folder / serial))

    @contextmanager
    def hold_alone(self) -> Iterator[None]:
        """Hold off others that add to records, or delete what records may cite: threads, and servers of this folder."""
        with hold_lock(self._folder / ".lock"):
            yield

    def refresh(self, now: bool = False) -> bool:
        """Read the records that have changed, many of them behind the page that waits; tell whether all are read.

        A page that reads at one moment does so before. ``now``: look although somebody has just looked.
        """
        read_at_once_s = 0.2  # for reading changed records while a page waits; the others are read behind it
        wait_s = 1.0 if now else 0.0  # for another one's look
        just_looked = not now and (time.monotonic() - self._looked < LOOK_S or self._db.is_within_transaction)
        if just_looked or not self._looking.acquire(timeout=wait_s):
            return not self._looking.locked()  # somebody has just looked, looks, or reads what is left
        left: list[tuple[str, str]] = []
        try:
            left = self._read_changed_records(self._find_changed_records(), read_at_once_s)
            self._looked = time.monotonic()
            if left:
                threading.Thread(target=self._read_remaining_records, args=(left,), name="records", daemon=True).start()
        finally:
            if not left:
                self._looking.release()
        return not left

    def _find_changed_records(self) -> list[tuple[str, str]]:
        """Return serial number and stamp of the records that are not in the index as they are; forget those gone."""
        known = {serial: stamp for serial, stamp in self._db.read("SELECT serial, stamp FROM robots")}
        there = {path.parent.name: _stamp(path.parent) for path in self._folder.glob("*/record.toml")}
        gone = [serial for serial in known if serial not in there]
        if gone:
            with self._db.write() as db:
                db.executemany("DELETE FROM robots WHERE serial = ?", [(serial,) for serial in gone])
        return sorted((serial, stamp) for serial, stamp in there.items() if known.get(serial) != stamp)

    def _read_changed_records(self, changed: list[tuple[str, str]], seconds: float) -> list[tuple[str, str]]:
        """Read records for some time, one at least; return those that are left."""
        begun = time.monotonic()
        for k, (serial, stamp) in enumerate(changed):
            if k and time.monotonic() - begun > seconds:
                return changed[k:]
            self._keep(serial, stamp)
        return []

    def _read_remaining_records(self, left: list[tuple[str, str]]) -> None:
        try:
            self._read_changed_records(left, float("inf"))
        finally:
            self._looking.release()

    def _keep(self, serial: str, stamp: str) -> None:
        """Read a record and write what the lists say of it; one that is damaged says so."""
        recorded: list[tuple[object, ...]] = []
        try:
            record = RobotRecord.read(self._folder / serial)
        except InputError as err:
            row: tuple[object, ...] = (serial, "", "damaged", str(err), None, "", 0, 0, stamp)
        else:
            for k, e in enumerate(record.entries):
                said = e.file.circumstances.model_dump_json()
                withdrawn = int(e.withdrawn is not None)
                recorded.append((serial, k, e.file.document_sha256, said, withdrawn, e.number, e.file.kind))
            due = None if record.next_check is None else record.next_check.isoformat()
            row = (
                serial, record.file.robot, _lasting_state(record), robot_advice(record), due, record.due_text,
                len(record.entries), int(record.simulated), stamp,
            )  # fmt: skip
        with self._db.write() as db:
            db.execute("DELETE FROM robots WHERE serial = ?", (serial,))
            db.execute("INSERT INTO robots VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
            db.executemany("INSERT INTO recorded VALUES (?, ?, ?, ?, ?, ?, ?)", recorded)


def _stamp(folder: Path) -> str:
    """Return a stamp that changes when something is added to a record or its file is edited."""
    try:
        return json.dumps([(folder / name).stat().st_mtime_ns for name in ("record.toml", "entries")])
    except OSError:
        return ""


def _summary(row: sqlite3.Row) -> RecordSummary:
    state, day = row["state"], row["due"]
    return RecordSummary(
        serial=row["serial"],
        robot=row["robot"],
        state=state,
        advice=ADVICE.get(state, row["advice"]),
        next_check=date.fromisoformat(day) if day else None,
        due=row["due_text"],
        entries=row["entries"],
        simulated=bool(row["simulated"]),
    )


PLACE = r"([0-9])~([0-9-]{0,10})~([^~]{1,100})"  # in a list of robots, as text


def _parse_place(text: str) -> dict[str, object]:
    """Return rank, day and serial number of a place in the list; before the first robot where there is none."""
    if not text:
        return {"rank": -1, "day": "", "serial": ""}
    found = re.fullmatch(PLACE, text)
    if found is None:
        raise InputError(f"after: '{text}' is no place in a list; take it from the Link header of the page before")
    return {"rank": int(found[1]), "day": found[2], "serial": found[3]}


def _lasting_state(record: RobotRecord) -> RobotState:
    """Return how a robot stands, whatever day it is."""
    if record.failure is not None:
        return "changed"
    if not record.valid_entries:
        return "withdrawn" if record.entries or record.file.withdrawn else "never measured"
    return "not calibrated" if record.calibration_date is None else "good"


def robot_state(record: RobotRecord) -> RobotState:
    """Return how a robot stands today."""
    state, day = _lasting_state(record), record.next_check
    return "check due" if state == "good" and day is not None and day < date.today() else state


def robot_advice(record: RobotRecord) -> str:
    """Return what a person does next."""
    if record.failure is not None:
        return record.due_text.removeprefix("now: ")
    return ADVICE.get(robot_state(record), "calibrate it")


def state_line(record: RobotRecord) -> str:
    """Return how a robot stands today in one line."""
    if record.failure is not None:
        failed, check = record.failure
        return f"changed on {failed.isoformat()}{f': {check.cause}' if check.cause else ''}"
    state, day = robot_state(record), record.next_check
    if state == "withdrawn":
        return "withdrawn: no entry of this serial number counts"
    if state not in ("good", "check due") or day is None:
        return state
    return f"good until {day.isoformat()}" if state == "good" else f"check due since {day.isoformat()}"
