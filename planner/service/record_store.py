"""The records of robots that the service keeps: the plain folders of ``edbb record``, one a serial number."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Literal

from planner.common.errors import InputError
from planner.common.result_folder import file_hash
from planner.common.system import hold_lock
from planner.instruments.record import BESIDE, DOCUMENTS, Circumstances, RobotRecord, add_entry, latest_day
from planner.service.file_store import FileStore
from planner.service.job_store import JobRecord, JobStore

RobotState = Literal["good", "check due", "changed", "not calibrated"]


class UnknownRecordError(InputError):
    """A robot that somebody names has no record."""


@dataclass(frozen=True)
class RecordedEntry:
    """What the record of a robot says of a result that was added to it; empty where it is in none."""

    serial: str = ""
    circumstances: Circumstances | None = None
    simulated: bool = False

    def field(self, name: str) -> str:
        """Return one of the circumstances as text."""
        value = None if self.circumstances is None else getattr(self.circumstances, name)
        return "" if value is None else str(value)


class RecordStore:
    """A folder of records; entries are made of what jobs have written."""

    def __init__(self, folder: Path, jobs: JobStore, files: FileStore) -> None:
        self._folder, self._jobs, self._files = folder / "records", jobs, files
        self._folder.mkdir(exist_ok=True)
        self._known: dict[Path, tuple[int, RobotRecord]] = {}

    def path(self, serial: str) -> Path:
        """Return the folder of a record.

        Raises:
            UnknownRecordError: there is none.
        """
        found = self._folder / serial
        if not (found / "record.toml").is_file():
            raise UnknownRecordError(f"there is no record of a robot {serial}")
        return found

    def read(self, serial: str) -> RobotRecord:
        """Return a record; read again only where something was added.

        Raises:
            UnknownRecordError: there is none.
            InputError: it is damaged.
        """
        folder = self.path(serial)
        number = len(list((folder / "entries").glob("*")))
        known = self._known.get(folder)
        if known is None or known[0] != number:
            known = self._known[folder] = (number, RobotRecord.read(folder))
        return known[1]

    def list_records(self) -> list[RobotRecord]:
        """Return all records by serial number."""
        return [self.read(p.parent.name) for p in sorted(self._folder.glob("*/record.toml"))]

    def find_entry(self, documents: set[str]) -> RecordedEntry:
        """Return the latest entry whose document has one of these SHA-256."""
        entries = ((r, e.file) for r in self.list_records() for e in r.entries)
        mine = [(r, e) for r, e in entries if e.document_sha256 in documents]
        known = [RecordedEntry(r.file.serial, e.circumstances, r.simulated) for r, e in mine]
        return known[-1] if known else RecordedEntry()

    def add(self, serial: str, job: JobRecord, circumstances: Circumstances, baseline: date | None) -> RobotRecord:
        """Add what a job has found to the record of a robot, which is made where there is none; once only.

        ``baseline``: day of the calibration that it is judged against, where that is known.

        Raises:
            InputError: the job has nothing for a record, or is of another model, or simulated beside real ones; its
                date is not allowed.
        """
        with self._alone(), tempfile.TemporaryDirectory(dir=self._folder) as draft:
            for output in self._jobs.outputs(job.id):
                if output.name in (*DOCUMENTS, *BESIDE):
                    shutil.copyfile(self._files.path(output.sha256), Path(draft, output.name))
            found = next((file_hash(p) for n in DOCUMENTS if (p := Path(draft, n)).is_file()), None)
            if found is None:
                raise InputError(f"the {job.kind} {job.id} has no result for a record: add a calibration or a check")
            folder = self._folder / serial
            there = (folder / "record.toml").is_file()
            if not there or found not in [e.file.document_sha256 for e in self.read(serial).entries]:
                add_entry(folder, Path(draft), circumstances, serial, baseline)
            return self.read(serial)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold off others that add: threads, and servers that share the folder."""
        with hold_lock(self._folder / ".lock"):
            yield


def robot_state(record: RobotRecord) -> RobotState:
    """Return how a robot stands today."""
    if record.failure is not None:
        return "changed"
    if record.calibrated is None:
        return "not calibrated"
    return "check due" if record.due is not None and record.due < latest_day() else "good"


def robot_advice(record: RobotRecord) -> str:
    """Return what a person does next."""
    if record.failure is not None:
        return record.due_text.removeprefix("now: ")
    says = {"good": "nothing until the next check", "check due": "measure the poses of a check"}
    return says.get(robot_state(record), "calibrate it")
