"""What jobs have found, in a word, and whether a calibration still holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from planner.checks.record import DOCUMENTS, AccuracyFile, CheckFile, RobotRecord, read_document
from planner.common.errors import PARTLY_DONE, InputError
from planner.common.schema import read_json, validate
from planner.service.answers import Job, Sense
from planner.service.certificate import Certificate
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
    """A check that counts: ``number`` of its entry in the record and its day, 0 and empty where it is in none yet."""

    day: str
    check: CheckFile
    number: int = 0
    job: str | None = None
    finished: float = 0.0

    def is_since(self, issued: Certificate) -> bool:
        """Tell whether a certificate did not know of it."""
        return self.number > issued.last_entry if self.number else self.finished >= issued.issued.timestamp()


def _judge_by(serial: str, checks: Sequence[JudgedCheck]) -> Standing:
    """Return what the first check that has failed says of a robot."""
    failed = next((c for c in checks if not c.check.passed), None)
    if failed is None:
        return Standing(serial)
    found = "; ".join(filter(None, (failed.check.cause, failed.check.advice)))
    note = f"check of {failed.day}" if failed.number else "its check is not in the record yet"
    robot, said = (f"robot {serial}", f" ({note})") if serial else ("robot", "")
    return Standing(serial, f"the {robot} has changed: {found}{said}", failed.job)


class Judge:
    """Says what jobs have found and whether calibrations hold, by their documents and the records of robots."""

    def __init__(self, jobs: JobStore, files: FileStore, records: RecordStore) -> None:
        self._jobs, self._files, self._records = jobs, files, records

    def verdict(self, job: Job) -> Verdict | None:
        """Return what a finished job has found; ``None`` where it judges nothing."""
        if job.state != "done":
            return None
        if job.kind == "compensation":
            is_part = job.exit_code == PARTLY_DONE
            return Verdict("corrected in part", "open") if is_part else Verdict("corrected", "good")
        found = next((f for f in job.files if f.name in DOCUMENTS), None)
        return None if found is None else _judge(self._files.path(found.sha256), found.name)

    def standing(self, job: str) -> Standing:
        """Return whether what an identification has found holds, by the record of its robot and by all checks."""
        documents = {o.sha256 for o in self._jobs.outputs(job) if o.name == "identification.json"}
        known = self._records.index.find_entry(documents)
        if known.serial:
            try:
                record = self._records.read(known.serial)
            except InputError as err:
                return Standing(known.serial, f"the record of {known.serial} cannot be read: {err}")
            return self.standing_in(record, known.number, documents)
        if any(self._records.index.is_withdrawn(d) for d in documents):
            return Standing("", "it was withdrawn from the record of its robot")
        return _judge_by("", self._made_checks(documents)[-1:])

    def standing_in(
        self, record: RobotRecord, number: int, documents: set[str], issued: Certificate | None = None
    ) -> Standing:
        """Return whether an entry of a record holds: withdrawn, followed by a calibration, or by a check that failed.

        The latest check counts; where a certificate was ``issued``, each since then. ``documents``: its SHA-256.
        """
        serial, place = record.file.serial, [e.number for e in record.entries].index(number)
        if (said := record.entries[place].withdrawn) is not None:
            return Standing(serial, f"its calibration was withdrawn on {said.date}: {said.reason}")
        after = [(e, e.file.circumstances.date) for e in record.entries[place + 1 :] if e.withdrawn is None]
        if newer := next((day for e, day in after if e.file.kind == "calibration"), None):
            return Standing(serial, f"{serial} was calibrated anew on {newer}")
        recorded = [
            JudgedCheck(day.isoformat(), e.document, e.number) for e, day in after if isinstance(e.document, CheckFile)
        ]
        made = self._made_checks(documents)
        if issued is None:
            recorded, made = recorded[-1:], made[-1:]
        checks = [*recorded, *(c for c in made if not c.number)]
        return _judge_by(serial, [c for c in checks if issued is None or c.is_since(issued)])

    def unrecorded_changes(self) -> dict[str, JudgedCheck]:
        """Return by serial number the failed checks that bind though they are in no record."""
        found = {}
        for job in self._records.index.unrecorded_checks():
            documents = {i.sha256 for i in self._jobs.get(job).command.inputs if i.name.endswith("identification.json")}
            known = self._records.index.find_entry(documents)
            holds = known.serial and known.number == self._records.index.last_calibration(known.serial)
            latest = self._made_checks(documents)[-1:] if holds else []
            if [c.job for c in latest if not c.check.passed] == [job]:
                found[known.serial] = latest[0]
        return found

    def _made_checks(self, documents: set[str]) -> list[JudgedCheck]:
        """Return the checks of a calibration by jobs here, but those that were withdrawn; the latest last."""
        found, index = [], self._records.index
        for job in [j for d in documents for j in self._jobs.jobs_with("inputs", d, "check")]:
            output = next((o for o in self._jobs.outputs(job.id) if o.name == "check.json"), None)
            if output is None or index.is_withdrawn(output.sha256):
                continue
            finished, check = job.finished or 0.0, read_check(self._files.path(output.sha256))
            found.append(JudgedCheck("", check, index.find_entry({output.sha256}).number, job.id, finished))
        return found
