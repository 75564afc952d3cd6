"""What jobs have found, in a word, and whether a calibration still holds."""

from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from planner.checks.record import DOCUMENTS, AccuracyFile, CheckFile, RecordEntry, RobotRecord, read_document
from planner.common.errors import PARTLY_DONE, InputError
from planner.common.schema import read_json, validate
from planner.service.answers import Job, Sense
from planner.service.file_store import FileStore
from planner.service.job_store import JobStore
from planner.service.record_store import RecordStore


@dataclass(frozen=True)
class Verdict:
    """What a job has found: a few words, and whether that is good."""

    words: str
    sense: Sense


@lru_cache(maxsize=4096)
def _judge(path: Path, name: str) -> Verdict | None:
    """Judge a document; content-addressed, so read once."""
    try:
        found = read_document(path, DOCUMENTS[name])
    except InputError:  # another version wrote it, or it was just deleted
        return None
    if isinstance(found, CheckFile):
        return Verdict(found.outcome, "good" if found.passed else "bad")
    if isinstance(found, AccuracyFile):
        return None if found.after is None else Verdict(f"{found.after.mean_mm:.3f} mm mean after", "open")
    if found.reason_not_to_use:
        return Verdict("not to be used", "bad")
    if (summary := found.summary) is None:
        return Verdict("calibrated", "open")
    senses: dict[str, Sense] = {"yes": "good", "no": "bad"}
    return Verdict(summary.headline, senses.get(summary.answer, "open"))


@lru_cache(maxsize=1024)
def read_check(path: Path) -> CheckFile:
    """Read what a check has found."""
    return validate(read_json(path), CheckFile, str(path))


@dataclass(frozen=True)
class Standing:
    """Whether a calibration still holds: ``fault`` says why not, ``serial`` of which robot it is, if that is known.

    ``job``: the check that has found a change, where there is one.
    """

    serial: str = ""
    fault: str = ""
    job: str | None = None


@dataclass(frozen=True)
class JudgedCheck:
    """A check of a calibration that counts, in a record or not yet in one."""

    job: str
    finished: float
    check: CheckFile
    recorded: bool

    @property
    def day(self) -> str:
        """When it was judged, UTC."""
        return datetime.fromtimestamp(self.finished, UTC).date().isoformat()

    def fault(self, serial: str) -> str:
        """Say what it has found, of which robot, and what to do."""
        note = "" if self.recorded or not serial else "; this check is not in the record yet"
        return changed_text(serial, self.check, self.day, note)


def change_text(check: CheckFile) -> str:
    """Return what a failed check has found, and what to do."""
    return "; ".join(filter(None, (check.cause, check.advice)))


def changed_text(serial: str, check: CheckFile, day: object, note: str = "") -> str:
    """Say that a robot has changed, by which check, and what to do."""
    return f"the {f'robot {serial}' if serial else 'robot'} has changed: {change_text(check)} (check of {day}{note})"


def newer_calibration_text(record: RobotRecord, entry: RecordEntry) -> str:
    """Say that a calibration of a record has come after an entry; empty where none has."""
    after = record.entries[record.entries.index(entry) + 1 :]
    newer = next((e for e in after if e.file.kind == "calibration" and e.withdrawn is None), None)
    return "" if newer is None else f"{record.file.serial} was calibrated anew on {newer.file.circumstances.date}"


class Judge:
    """Says what jobs have found and whether calibrations hold, by their documents and the records of robots."""

    def __init__(self, jobs: JobStore, files: FileStore, records: RecordStore) -> None:
        self._jobs, self._files, self._records = jobs, files, records

    def verdict(self, job: Job) -> Verdict | None:
        """Return what a finished job has found; ``None`` where it judges nothing."""
        if job.state != "done":
            return None
        if job.kind == "compensation":
            return (
                Verdict("corrected in part", "open") if job.exit_code == PARTLY_DONE else Verdict("corrected", "good")
            )
        found = next((f for f in job.files if f.name in DOCUMENTS), None)
        return None if found is None else _judge(self._files.path(found.sha256), found.name)

    def standing(self, job: str) -> Standing:
        """Return whether what an identification has found holds, by the record of its robot and by all checks."""
        documents = {o.sha256 for o in self._jobs.outputs(job) if o.name == "identification.json"}
        known = self._records.index.find_entry(documents)
        checks = [c for sha256 in documents for c in self._checks(sha256)]
        latest = checks[-1] if checks and not (checks[-1].check.passed or checks[-1].recorded) else None
        if not known.serial:
            if any(self._records.index.is_withdrawn(d) for d in documents):
                return Standing("", "it was withdrawn from the record of its robot")
            return Standing("", latest.fault(""), latest.job) if latest else Standing()
        try:
            record = self._records.read(known.serial)
        except InputError as err:
            return Standing(known.serial, f"the record of {known.serial} cannot be read: {err}")
        entry = next(e for e in record.entries if e.number == known.number)
        if newer := newer_calibration_text(record, entry):
            return Standing(known.serial, newer)
        if latest is not None:
            return Standing(known.serial, latest.fault(known.serial), latest.job)
        if (failure := record.failure) is not None:
            day, check = failure
            return Standing(known.serial, changed_text(known.serial, check, day))
        return Standing(known.serial)

    def failed_checks(self, document: str) -> list[JudgedCheck]:
        """Return the checks that have found a change since a calibration, by the SHA-256 of its document."""
        return [c for c in self._checks(document) if not c.check.passed]

    def _checks(self, document: str) -> list[JudgedCheck]:
        """Return the checks of a calibration that count, the latest last."""
        found, index = [], self._records.index
        for job in self._jobs.jobs_with("inputs", document, "check"):
            output = next((o for o in self._jobs.outputs(job.id) if o.name == "check.json"), None)
            if output is None or index.is_withdrawn(output.sha256):
                continue
            recorded = bool(index.find_entry({output.sha256}).serial)
            check = read_check(self._files.path(output.sha256))
            found.append(JudgedCheck(job.id, job.finished or 0.0, check, recorded))
        return found
