"""The record of one physical robot: a plain folder of what was done to it, and what changed in between.

``record.toml`` says which robot it is; ``entries/0001-calibration/`` and so on hold ``entry.json`` and the results as
they were. Nothing is ever changed or taken out.
"""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tomli_w
from pydantic import Field

from planner.common.errors import InputError
from planner.common.files import document_text, has_hash, read_bytes, text_hash, write_text
from planner.common.result_folder import draft_folder, move_all
from planner.common.schema import PartialModel, StrictModel, read_json, read_toml, validate
from planner.common.units import to_mm
from planner.kinematics.nominal_model import describe_difference, nominal_numbers
from planner.model.identification_document import Identification

EntryKind = Literal["calibration", "validation", "check"]
DOCUMENTS: dict[str, EntryKind] = {
    "identification.json": "calibration",
    "accuracy.json": "validation",
    "check.json": "check",
}
ROBOT = "robot.toml"
BESIDE = (ROBOT, "posterior.json", "expected_error.json")  # kept with a calibration
EARLIEST = date(2000, 1, 1)  # of anything in a record: before it there is nothing to add


class RecordFile(StrictModel):
    """``record.toml``: serial number and model of the robot, and how often it is to be checked."""

    schema_: Literal["edbb-record/1"] = Field(alias="schema")
    serial: Annotated[str, Field(min_length=1, max_length=100)]
    robot: str
    check_days: Annotated[int, Field(ge=1, le=3650)] = 30


class Circumstances(StrictModel):
    """Who, when, and with what."""

    date: date
    operator: str = ""
    temperature_degC: Annotated[float, Field(ge=-30, le=80)] | None = None
    tool: str = ""
    gauge: str = ""
    certificate: str = ""


class EntryFile(StrictModel):
    """``entry.json``: what was added, by the hash of its document."""

    schema_: Literal["edbb-record-entry/1"] = Field(alias="schema")
    kind: EntryKind
    document_sha256: str
    circumstances: Circumstances


class CheckedChange(PartialModel):
    """What ``check.json`` says of one change."""

    change: str
    motion_mm: float
    std_mm: float
    detectable_mm: float | None = None
    values: dict[str, float]


class CheckFile(PartialModel):
    """What the record needs of ``check.json``."""

    robot: str
    outcome: str
    advice: str
    cause: str | None
    rivals: tuple[str, ...] = ()
    p_value: float
    threshold: float
    changes: tuple[CheckedChange, ...]
    notes: tuple[str, ...] = ()
    simulated: bool = False

    @property
    def passed(self) -> bool:
        """Whether the robot may go on."""
        return self.outcome != "changed"

    @property
    def decades(self) -> float:
        """How far the readings are beyond chance: above zero something has changed."""
        return float(np.log10(max(self.threshold, 1e-300) / max(self.p_value, 1e-300)))


class PosePerformanceFile(PartialModel):
    """AP and RP of poses that a tracker saw several times, means over ``poses`` of them (section ``iso9283``)."""

    poses: int
    AP_mm: float
    RP_mm: float


class AccuracyFigures(PartialModel):
    """Errors of ``accuracy.json``."""

    mean_mm: float
    max_mm: float
    iso9283: PosePerformanceFile | None = None


class AccuracyFile(PartialModel):
    """What the record needs of ``accuracy.json``."""

    robot: str
    run: str
    before: AccuracyFigures | None = None
    after: AccuracyFigures | None = None
    simulated: bool = False


@dataclass(frozen=True)
class RecordEntry:
    """One entry with its document; ``said`` sums it up."""

    number: int
    file: EntryFile
    document: Identification | CheckFile | AccuracyFile

    @property
    def simulated(self) -> bool:
        """Tell whether nobody measured it."""
        return bool(self.document.simulated)

    @property
    def sentence(self) -> str:
        """Return the entry in words."""
        return f"SIMULATED: {self._finding}" if self.simulated else self._finding

    @property
    def _finding(self) -> str:
        d = self.document
        if isinstance(d, CheckFile):
            return d.outcome if d.cause is None else f"{d.outcome}: {d.cause}; {d.advice}"
        if isinstance(d, AccuracyFile):
            parts = (("before", d.before), ("after", d.after))
            return "; ".join(f"{n} {f.mean_mm:.3f} mm mean, {f.max_mm:.3f} mm largest" for n, f in parts if f)
        before = None if d.release is None else d.release.nominal_anywhere
        lead = "" if before is None else f"{to_mm(before):.3f} mm → "
        return f"tool error over the workspace {lead}{to_mm(d.workspace_error):.3f} mm"


@dataclass(frozen=True)
class AxisDrift:
    """The zero of one axis by every check, as motion of the tool if it alone had moved, and σ [mm]; nan: not known."""

    name: str
    motions: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class RobotRecord:
    """One robot and its entries, by date, and of one day as they were added."""

    file: RecordFile
    entries: tuple[RecordEntry, ...]

    @classmethod
    def read(cls, folder: Path) -> "RobotRecord":
        """Read a record.

        Raises:
            InputError: it is none, or a document is not what was added.
        """
        file = read_toml(folder / "record.toml", RecordFile)
        found = sorted(p for p in (folder / "entries").glob("[0-9]*-*") if p.is_dir())
        entries = sorted(map(_read_entry, found), key=lambda e: (e.file.circumstances.date, e.number))
        other = next((e for e in entries if e.document.robot != file.robot), None)
        if other is not None:
            raise InputError(
                f"{folder / 'record.toml'} is the record of {file.robot}, but entry {other.number} is of "
                f"{other.document.robot}: one of them was changed; fetch it from a backup"
            )
        return cls(file, tuple(entries))

    @property
    def simulated(self) -> bool:
        """Tell whether nobody has measured this robot: there is none."""
        return any(e.simulated for e in self.entries)

    @property
    def next_check(self) -> date | None:
        """Day of the next check: after a failed one its own day, as it is due at once."""
        if self.failure is not None:
            return self.failure[0]
        days = [e.file.circumstances.date for e in self.entries if e.file.kind != "validation"]
        return max(days) + timedelta(days=self.file.check_days) if days else None

    @property
    def due_text(self) -> str:
        """The same in words, after a failed check with what to do before; empty where nothing is due."""
        if self.failure is None:
            return "" if self.next_check is None else self.next_check.isoformat()
        advice = self.failure[1].advice
        return f"now: {advice}" if "again" in advice else f"now: {advice}, then check or calibrate again"

    @property
    def failure(self) -> tuple[date, CheckFile] | None:
        """The latest check, where it has found a change and the robot was not calibrated since."""
        last = next((e for e in self.entries[::-1] if e.file.kind != "validation"), None)
        if last is None or not isinstance(last.document, CheckFile) or last.document.passed:
            return None
        return last.file.circumstances.date, last.document

    @property
    def calibration_date(self) -> date | None:
        """Day of the calibration that still holds; ``None`` where none does, or a check since has found a change."""
        return None if self.failure or not self.calibrations else self.calibrations[-1]

    @property
    def calibrations(self) -> tuple[date, ...]:
        """Day of every calibration."""
        return tuple(e.file.circumstances.date for e in self.entries if e.file.kind == "calibration")

    @property
    def checks(self) -> tuple[tuple[date, CheckFile], ...]:
        """Every check with its day."""
        return tuple((e.file.circumstances.date, e.document) for e in self.entries if isinstance(e.document, CheckFile))

    @property
    def drifts(self) -> tuple[AxisDrift, ...]:
        """Return the zeros of all axes by all checks."""
        lines: dict[str, list[tuple[float, float]]] = {}
        for k, (_, check) in enumerate(self.checks):
            for c in (c for c in check.changes if c.change.startswith("zero of ")):
                motion = float(np.copysign(c.motion_mm, sum(c.values.values())))
                lines.setdefault(c.change, [(float("nan"),) * 2] * len(self.checks))[k] = (motion, c.std_mm)
        return tuple(AxisDrift(n.removeprefix("zero of "), tuple(v)) for n, v in sorted(lines.items()))

    def differences(self) -> Iterator[tuple[int, str]]:
        """Yield what differs between a calibration and the one before by more than chance: entry, and in words."""
        found = [(e.number, e.document) for e in self.entries if isinstance(e.document, Identification)]
        for (_, first), (number, second) in pairwise(found):
            known = {p.name: p for p in first.estimates if p.std}
            for p in second.estimates:
                old = known.get(p.name)
                if old is None or not p.std or not old.std or p.group != "geometry":
                    continue
                std = float((p.std**2 + old.std**2) ** 0.5)
                if abs(p.value - old.value) > 3.0 * std:  # sigmas of the difference: beyond, it has moved
                    yield number, f"{p.name} {p.value - old.value:+.2e} ± {std:.1e} {p.unit}"


def _read_entry(folder: Path) -> RecordEntry:
    file = validate(read_json(folder / "entry.json"), EntryFile, str(folder / "entry.json"))
    path = folder / next(name for name, kind in DOCUMENTS.items() if kind == file.kind)
    if not has_hash(read_bytes(path), file.document_sha256):
        raise InputError(f"{path} is not what was added to the record: its hash differs; fetch it from a backup")
    return RecordEntry(int(folder.name.partition("-")[0]), file, _read_document(path, file.kind))


def _read_document(path: Path, kind: EntryKind) -> Identification | CheckFile | AccuracyFile:
    if kind == "calibration":
        return Identification.read(path)
    if kind == "check":
        return validate(read_json(path), CheckFile, str(path))
    return validate(read_json(path), AccuracyFile, str(path))


def latest_day() -> date:
    """Return today, here or in UTC, whichever is later."""
    return max(date.today(), datetime.now(UTC).date())


def _require_day(day: date, kind: EntryKind, known: RobotRecord, baseline: date | None) -> None:
    """Refuse a day to come, and one before the calibration that the entry is judged against."""
    why = ""
    first = EARLIEST
    if kind != "calibration" and (days := [baseline] if baseline else known.calibrations[:1]):
        first, why = days[0], " (its calibration)"
    if not first <= day <= latest_day():
        raise InputError(
            f"the {kind} is dated {day.isoformat()}; allowed are {first.isoformat()}{why} to "
            f"{latest_day().isoformat()} (today)"
        )


def _require_success(path: Path, document: Identification | CheckFile | AccuracyFile) -> None:
    """Refuse a calibration that failed: a record holds what its robot may work by."""
    if isinstance(document, Identification) and document.reason_not_to_use:
        raise InputError(
            f"{path} is no calibration, it says: {document.reason_not_to_use}; measure again, and add what "
            "'edbb identify' makes of that run"
        )


def _require_same_model(path: Path, record: Path) -> None:
    """Refuse a calibration whose nominal model is another than that of the first calibration of the record."""
    first = next(iter(sorted((record / "entries").glob(f"[0-9]*-*/{ROBOT}"))), None)
    if first is None or not path.is_file():
        return
    if said := describe_difference(nominal_numbers(first), nominal_numbers(path)):
        raise InputError(
            f"{path} has another nominal model than {first}: {said}; a record is of one robot and one nominal model, "
            "keep what belongs to another under a serial number of its own"
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
    kind, document = DOCUMENTS[name], _read_document(results / name, DOCUMENTS[name])
    _require_success(results / name, document)
    robot = document.robot
    is_new = not (record / "record.toml").is_file()
    if is_new and serial is None:
        raise InputError(f"{record} is no record yet: name the robot's serial number with --serial")
    file = RecordFile(schema="edbb-record/1", serial=str(serial), robot=robot)
    known = RobotRecord(file, ()) if is_new else RobotRecord.read(record)
    if robot != known.file.robot:
        raise InputError(f"{results / name} is of {robot}, but {record} is the record of {known.file.robot}")
    if serial not in (None, known.file.serial):
        raise InputError(f"{record} is the record of serial number {known.file.serial}, found {serial}")
    if known.entries and bool(document.simulated) != known.simulated:
        raise InputError(
            f"{results / name} is {'simulated' if document.simulated else 'measured'}, but {record} is the record of a "
            f"robot that is {'simulated' if known.simulated else 'real'}: keep simulated ones under serial numbers of "
            "their own"
        )
    content = read_bytes(results / name)
    if any(has_hash(content, e.file.document_sha256) for e in known.entries):
        raise InputError(f"{results / name} is in the record already")
    _require_day(circumstances.date, kind, known, baseline)
    _require_same_model(results / ROBOT, record)
    entry = EntryFile(
        schema="edbb-record-entry/1",
        kind=kind,
        document_sha256=text_hash(content),
        circumstances=circumstances,
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
            write_text(draft / "record.toml", tomli_w.dumps(file.model_dump(by_alias=True)))
        move_all(draft, place)
    return RobotRecord.read(record)
