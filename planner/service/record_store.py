"""The records of robots that the service keeps: the plain folders of ``edbb record``, one a serial number."""

import io
import shutil
import tempfile
import zipfile
from pathlib import Path

from planner.checks.record import BESIDE, DOCUMENTS, Circumstances, RobotRecord, Withdrawal
from planner.checks.record_changes import add_entry, begin_record, withdraw_entry, withdraw_record
from planner.common.errors import InputError
from planner.common.result_folder import file_hash
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_record import JobRecord
from planner.service.job_store import JobStore
from planner.service.record_index import RecordedEntry, RecordIndex


class UnknownRecordError(InputError):
    """A robot, or an entry of its record, that somebody names is not there."""


class RecordConflictError(InputError):
    """Something that a record, as it is, does not allow."""


class RecordStore:
    """A folder of records; entries are made of what jobs have written. ``index``: what the lists say of all."""

    def __init__(self, folder: Path, jobs: JobStore, files: FileStore, database: Database) -> None:
        self._folder, self._jobs, self._files = folder / "records", jobs, files
        self._folder.mkdir(exist_ok=True)
        self.index = RecordIndex(self._folder, database)
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
        number = (folder / "entries").stat().st_mtime_ns
        known = self._known.get(folder)
        if known is None or known[0] != number:
            known, most = (number, RobotRecord.read(folder)), 50  # records that are held in memory
            self._known = dict([*self._known.items(), (folder, known)][-most:])
        return known[1]

    def begin(self, serial: str, robot: str) -> RobotRecord:
        """Make the record of a robot that was never measured, or bring a withdrawn one back; another stays as it is.

        Raises:
            RecordConflictError: it is there, of another model, or another serial number differs by case alone.
        """
        with self.index.hold_alone():
            if not self._is_there(serial) or self.read(serial).is_mistake:
                begin_record(self._folder / serial, serial, robot)
                self.index.read(serial)
            return self.require(serial, robot)

    def require(self, serial: str, robot: str) -> RobotRecord:
        """Return the record of a robot of a model, to be measured.

        Raises:
            UnknownRecordError: there is none.
            RecordConflictError: the serial number was withdrawn, or is of another model.
        """
        known = self.read(serial)
        if known.file.withdrawn is not None and known.is_mistake:
            reason = known.file.withdrawn.reason
            raise RecordConflictError(f"the serial number {serial} was withdrawn ({reason}): add the robot again first")
        if known.file.robot != robot:
            raise RecordConflictError(f"{serial} is the serial number of a {known.file.robot} here, not of a {robot}")
        return known

    def _is_there(self, serial: str) -> bool:
        """Tell whether a serial number has a record.

        Raises:
            RecordConflictError: it has none, but one that differs by case alone.
        """
        names = [p.parent.name for p in self._folder.glob("*/record.toml")]  # Windows would find another case, too
        twin = next((name for name in names if name.lower() == serial.lower()), None)
        if twin is not None and serial not in names:
            raise RecordConflictError(f"there is a robot {twin}: write its serial number as there, not {serial}")
        return twin is not None

    def withdraw(self, serial: str, number: int | None, withdrawal: Withdrawal) -> RobotRecord:
        """Let an entry count no more, or (``None``) a serial number without any; it stays, with the reason.

        Raises:
            UnknownRecordError: there is no such record or entry.
            RecordConflictError: it was withdrawn already, or the serial number has entries that count.
        """
        with self.index.hold_alone():
            if number is not None and number not in [e.number for e in self.read(serial).entries]:
                raise UnknownRecordError(f"{serial} has no entry {number}")
            try:
                if number is None:
                    withdraw_record(self.path(serial), withdrawal)
                else:
                    withdraw_entry(self.path(serial), number, withdrawal)
            except InputError as err:
                raise RecordConflictError(str(err)) from err
            self.index.read(serial)
            return self.read(serial)

    def add(self, serial: str, job: JobRecord, circumstances: Circumstances, judged: RecordedEntry) -> RobotRecord:
        """Add what a job has found to the record of a robot, which is made where there is none; once only.

        ``judged``: the entry of the calibration that it is judged against, where that is known.

        Raises:
            UnknownJobError: the job is gone.
            InputError: it has nothing for a record, or belongs to another robot, or is of another model, or simulated
                beside real ones; its date is not allowed.
        """
        with self.index.hold_alone(), tempfile.TemporaryDirectory(dir=self._folder) as draft:
            self._jobs.get(job.id)  # it may have been deleted meanwhile
            for output in self._jobs.outputs(job.id):
                if output.name in (*DOCUMENTS, *BESIDE):
                    shutil.copyfile(self._files.path(output.sha256), Path(draft, output.name))
            found = next((file_hash(p) for n in DOCUMENTS if (p := Path(draft, n)).is_file()), None)
            if found is None:
                raise InputError(f"the {job.kind} {job.id} has no result for a record: add a calibration or a check")
            _require_one_robot(serial, self.index.find_entry({found} | self._found_by_runs(job)), judged)
            folder, there = self._folder / serial, self._is_there(serial)
            if not there or found not in [e.file.document_sha256 for e in self.read(serial).valid_entries]:
                day = None if judged.circumstances is None else judged.circumstances.date
                if there and job.kind == "check":
                    _require_latest_calibration(self.read(serial), judged, circumstances)
                add_entry(folder, Path(draft), circumstances, serial, day)
                self.index.read(serial)
            return self.read(serial)

    def _found_by_runs(self, job: JobRecord) -> set[str]:
        """Return the hashes of what jobs of its kind have found in the runs of a job: a run is of one robot."""
        words = job.command.words
        runs = {i.sha256 for i in job.command.inputs if i.name in words and i.name.endswith((".csv", ".parquet"))}
        jobs = [other.id for run in runs for other in self._jobs.jobs_with("inputs", run, job.kind)]
        return {o.sha256 for id in jobs for o in self._jobs.outputs(id) if o.name in DOCUMENTS}

    def pack(self, serial: str) -> bytes:
        """Return the folder of a record as ZIP.

        Raises:
            UnknownRecordError: there is none.
        """
        folder, packed = self.path(serial), io.BytesIO()
        with self.index.hold_alone(), zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in sorted(p for p in folder.rglob("*") if p.is_file()):
                archive.write(path, Path(serial, path.relative_to(folder)))
        return packed.getvalue()


def _require_latest_calibration(record: RobotRecord, judged: RecordedEntry, said: Circumstances) -> None:
    """Refuse a check by a calibration that a newer one had replaced: it says nothing of the robot as it is since."""
    before = [
        e for e in record.valid_entries if e.file.kind == "calibration" and e.file.circumstances.date <= said.date
    ]
    if judged.number and before and before[-1].number > judged.number:
        newer = before[-1]
        raise InputError(
            f"it is judged against the calibration of entry {judged.number}, but {record.file.serial} was calibrated "
            f"anew on {newer.file.circumstances.date} (entry {newer.number}): judge its run by that calibration"
        )


def _require_one_robot(serial: str, known: RecordedEntry, judged: RecordedEntry) -> None:
    """Refuse a result that belongs to a robot of another serial number: it is one robot's alone."""
    if known.serial not in ("", serial):
        raise InputError(
            f"this {known.kind}, or one of the same run, is entry {known.number} of the robot {known.serial}, and "
            f"belongs to that robot alone; if {known.serial} was a mistake, withdraw the entry there with a reason, "
            "then add it here"
        )
    if judged.serial not in ("", serial):
        raise InputError(
            f"it is judged against a calibration of the robot {judged.serial}: add it to the record of {judged.serial}"
        )
