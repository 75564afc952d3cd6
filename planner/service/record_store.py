"""The records of robots that the service keeps: the plain folders of ``edbb record``, one a serial number."""

import io
import shutil
import tempfile
import zipfile
from datetime import date
from pathlib import Path

from planner.checks.record import BESIDE, DOCUMENTS, Circumstances, RobotRecord, add_entry
from planner.common.errors import InputError
from planner.common.result_folder import file_hash
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_record import JobRecord
from planner.service.job_store import JobStore
from planner.service.record_index import RecordIndex


class UnknownRecordError(InputError):
    """A robot that somebody names has no record."""


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
        number = len(list((folder / "entries").glob("*")))
        known = self._known.get(folder)
        if known is None or known[0] != number:
            known, most = (number, RobotRecord.read(folder)), 50  # records that are held in memory
            self._known = dict([*self._known.items(), (folder, known)][-most:])
        return known[1]

    def add(self, serial: str, job: JobRecord, circumstances: Circumstances, baseline: date | None) -> RobotRecord:
        """Add what a job has found to the record of a robot, which is made where there is none; once only.

        ``baseline``: day of the calibration that it is judged against, where that is known.

        Raises:
            UnknownJobError: the job is gone.
            InputError: it has nothing for a record, or is of another model, or simulated beside real ones; its
                date is not allowed.
        """
        with self.index.hold_alone(), tempfile.TemporaryDirectory(dir=self._folder) as draft:
            self._jobs.get(job.id)  # it may have been deleted meanwhile
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
                self.index.read(serial)
            return self.read(serial)

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
