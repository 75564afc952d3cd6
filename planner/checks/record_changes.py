"""What changes the record of a robot: it is begun, results are added, and entries are withdrawn with a reason."""

import os
import shutil
from datetime import date, datetime, timedelta, timezone
from pathlib import Path

import tomli_w

from planner.checks.record import (
    BESIDE,
    DOCUMENTS,
    EARLIEST,
    ROBOT,
    WITHDRAWN,
    Circumstances,
    EntryFile,
    EntryKind,
    RecordedDocument,
    RecordFile,
    RobotRecord,
    Withdrawal,
    read_document,
)
from planner.common.errors import InputError
from planner.common.files import document_text, has_hash, read_bytes, text_hash, write_text
from planner.common.result_folder import draft_folder, move_all
from planner.kinematics.nominal_model import describe_difference, nominal_numbers
from planner.model.identification_document import Identification


def latest_day() -> date:
    """Return the latest day that has begun anywhere: people need not be in the zone of this machine."""
    easternmost = timezone(timedelta(hours=14))
    return datetime.now(easternmost).date()


def _require_day(day: date, kind: EntryKind, known: RobotRecord, baseline: date | None) -> None:
    """Refuse a day to come, and one before the calibration that the entry is judged against."""
    why = ""
    first = EARLIEST
    if kind != "calibration" and (days := [baseline] if baseline else known.calibrations[:1]):
        first, why = days[0], " (its calibration)"
    if not first <= day <= latest_day():
        raise InputError(
            f"the {kind} is dated {day.isoformat()}; allowed are {first.isoformat()}{why} to "
            f"{latest_day().isoformat()} (today in the east)"
        )


def _require_success(path: Path, document: RecordedDocument) -> None:
    """Refuse a calibration that failed: a record holds what its robot may work by."""
    if isinstance(document, Identification) and document.reason_not_to_use:
        raise InputError(
            f"{path} is no calibration, it says: {document.reason_not_to_use}; measure again, and add what "
            "'edbb identify' makes of that run"
        )


def _require_same_model(path: Path, record: Path, known: RobotRecord) -> None:
    """Refuse a calibration whose nominal model is another than that of the first calibration of the record."""
    folders = (record / "entries" / f"{e.number:04d}-{e.file.kind}" for e in known.valid_entries)
    first = next((f / ROBOT for f in folders if (f / ROBOT).is_file()), None)
    if first is None or not path.is_file():
        return
    if said := describe_difference(nominal_numbers(first), nominal_numbers(path)):
        raise InputError(
            f"{path} has another nominal model than {first}: {said}; a record is of one robot and one nominal model, "
            "keep what belongs to another under a serial number of its own"
        )


def _require_same_robot(
    path: Path, document: RecordedDocument, serial: str | None, record: Path, known: RobotRecord
) -> None:
    """Refuse results of another robot, and simulated ones beside real ones; what was withdrawn binds nothing."""
    counted = known.valid_entries
    if document.robot != known.file.robot and (counted or not (known.entries or known.is_mistake)):
        raise InputError(f"{path} is of {document.robot}, but {record} is the record of {known.file.robot}")
    if serial not in (None, known.file.serial):
        raise InputError(f"{record} is the record of serial number {known.file.serial}, found {serial}")
    if counted and bool(document.simulated) != known.simulated:
        raise InputError(
            f"{path} is {'simulated' if document.simulated else 'measured'}, but {record} is the record of a "
            f"robot that is {'simulated' if known.simulated else 'real'}: keep simulated ones under serial numbers of "
            "their own"
        )


def add_entry(
    record: Path, results: Path, circumstances: Circumstances, serial: str | None, baseline: date | None = None
) -> RobotRecord:
    """Add a folder of results to a record, which is made if ``serial`` says of which robot.

    ``baseline``: day of the calibration that a check or validation is judged against, where it is known; else the
    first of the record is taken.

    Raises:
        InputError: the folder holds no results for a record, those of another robot or nominal model, or a calibration
            that failed or is worse than the nominal robot; there is no record; the date is in the future, or before
            the calibration.
    """
    name = next((n for n in DOCUMENTS if (results / n).is_file()), None)
    if name is None:
        raise InputError(f"{results} holds none of {', '.join(DOCUMENTS)}: add what identify, accuracy or check wrote")
    kind, document = DOCUMENTS[name], read_document(results / name, DOCUMENTS[name])
    _require_success(results / name, document)
    robot = document.robot
    is_new = not (record / "record.toml").is_file()
    if is_new and serial is None:
        raise InputError(f"{record} is no record yet: name the robot's serial number with --serial")
    file = RecordFile(schema="edbb-record/1", serial=str(serial), robot=robot)
    known = RobotRecord(file, ()) if is_new else RobotRecord.read(record)
    _require_same_robot(results / name, document, serial, record, known)
    content = read_bytes(results / name)
    if any(has_hash(content, e.file.document_sha256) for e in known.valid_entries):
        raise InputError(f"{results / name} is in the record already; without --add the record is shown")
    _require_day(circumstances.date, kind, known, baseline)
    _require_same_model(results / ROBOT, record, known)
    entry = EntryFile(
        schema="edbb-record-entry/1", kind=kind, document_sha256=text_hash(content), circumstances=circumstances
    )
    number = max((e.number for e in known.entries), default=0) + 1
    entry_name = f"entries/{number:04d}-{kind}"
    place = record if is_new else record / entry_name  # a new record appears with its first entry
    with draft_folder(place) as draft:
        folder = draft / entry_name if is_new else draft
        folder.mkdir(parents=True, exist_ok=True)
        for file_name in (name, *BESIDE):
            if (results / file_name).is_file():
                shutil.copyfile(results / file_name, folder / file_name)
        write_text(folder / "entry.json", document_text(entry.model_dump(mode="json", by_alias=True)))
        if is_new:
            _write_head(draft, file)
        move_all(draft, place)
    if not is_new and robot != known.file.robot:  # all that it held was withdrawn: it was another robot's
        _write_head(record, known.file.model_copy(update={"robot": robot}))
    return RobotRecord.read(record)


def begin_record(record: Path, serial: str, robot: str) -> RobotRecord:
    """Make the record of a robot that was never measured, or bring one back that was withdrawn; ``robot``: its model.

    Raises:
        InputError: it has one already.
    """
    if (record / "record.toml").is_file():
        if not (known := RobotRecord.read(record)).is_mistake:
            raise InputError(f"the robot {serial} has a record already")
        _write_head(record, known.file.model_copy(update={"robot": robot, "withdrawn": None}))
        os.utime(record / "entries")
        return RobotRecord.read(record)
    with draft_folder(record) as draft:
        (draft / "entries").mkdir(parents=True)
        _write_head(draft, RecordFile(schema="edbb-record/1", serial=serial, robot=robot))
        move_all(draft, record)
    return RobotRecord.read(record)


def _write_head(record: Path, file: RecordFile) -> None:
    write_text(record / "record.toml", tomli_w.dumps(file.model_dump(by_alias=True, exclude_none=True)))


def withdraw_record(record: Path, withdrawal: Withdrawal) -> RobotRecord:
    """Let a serial number that has no entry that counts be a mistake.

    Raises:
        InputError: it has some, or was withdrawn already.
    """
    known = RobotRecord.read(record)
    if known.is_mistake:
        raise InputError(f"the robot {known.file.serial} was withdrawn already")
    if known.valid_entries:
        there = ", ".join(str(e.number) for e in known.valid_entries)
        raise InputError(f"the robot {known.file.serial} has entries that count ({there}): withdraw these instead")
    _write_head(record, known.file.model_copy(update={"withdrawn": withdrawal}))
    os.utime(record / "entries")
    return RobotRecord.read(record)


def withdraw_entry(record: Path, number: int, withdrawal: Withdrawal) -> RobotRecord:
    """Let an entry count no more; it stays where it is, with the reason.

    Raises:
        InputError: there is no such entry, or it was withdrawn already.
    """
    known = RobotRecord.read(record)
    entry = next((e for e in known.entries if e.number == number), None)
    if entry is None:
        there = ", ".join(str(e.number) for e in known.valid_entries) or "none"
        raise InputError(f"{record} has no entry {number}; entries that count: {there}")
    if entry.withdrawn is not None:
        raise InputError(f"entry {number} of {record} was withdrawn already: {entry.withdrawn.reason}")
    folder = record / "entries" / f"{number:04d}-{entry.file.kind}"
    write_text(folder / WITHDRAWN, document_text(withdrawal.model_dump(mode="json")))
    os.utime(record / "entries")  # whoever keeps an index by its time of change reads the record again
    return RobotRecord.read(record)
