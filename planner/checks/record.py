"""The record of one physical robot: a plain folder of what was done to it, and what changed in between.

``record.toml`` says which robot it is; ``entries/0001-calibration/`` and so on hold ``entry.json`` and the results as
they were. Nothing is ever changed or taken out: an entry that is wrong is withdrawn with a reason, which
``withdrawn.json`` beside it says, and counts no more.

A robot's record as the values of an OPC UA object: ``CalibrationPrognosisType`` (OPC 40210, 8.11).

It is a prognosis as those of OPC 40501-1, 8.6.4 (``PredictedTime``); the robot is named by the properties of a motion
device of OPC 40010-1, 7.2 (from OPC 10000-100). OPC 40010-1 has no calibration of its own.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_pascal

from planner.common.errors import InputError
from planner.common.files import has_hash, read_bytes
from planner.common.schema import PartialModel, ReasonText, Statement, StrictModel, read_json, read_toml, validate
from planner.common.units import to_mm
from planner.model.identification_document import Identification

EntryKind = Literal["calibration", "validation", "check"]
DOCUMENTS: dict[str, EntryKind] = {
    "identification.json": "calibration",
    "accuracy.json": "validation",
    "check.json": "check",
}
ROBOT = "robot.toml"
WITHDRAWN = "withdrawn.json"
BESIDE = (ROBOT, "posterior.json", "expected_error.json")  # kept with a calibration
EARLIEST = date(2000, 1, 1)  # of anything in a record: before it there is nothing to add


class Withdrawal(StrictModel):
    """``withdrawn.json``: why an entry (in ``record.toml``: the serial number) counts no more, who said so, when."""

    reason: ReasonText
    by: Annotated[str, Field(max_length=100)] = ""
    date: date


class RecordFile(StrictModel):
    """``record.toml``: serial number and model of the robot, and how often it is to be checked."""

    schema_: Literal["edbb-record/1"] = Field(alias="schema")
    serial: Annotated[str, Field(min_length=1, max_length=100)]
    robot: str
    check_days: Annotated[int, Field(ge=1, le=3650)] = 30
    withdrawn: Withdrawal | None = None


class Circumstances(StrictModel):
    """Who, when, and with what."""

    date: date
    operator: Statement = ""
    temperature_degC: Annotated[float, Field(ge=-30, le=80, strict=True)] | None = None
    tool: Statement = ""
    gauge: Statement = ""
    certificate: Statement = ""


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


RecordedDocument = Identification | CheckFile | AccuracyFile


@dataclass(frozen=True)
class RecordEntry:
    """One entry with its document; ``withdrawn`` where it counts no more."""

    number: int
    file: EntryFile
    document: RecordedDocument
    withdrawn: Withdrawal | None = None

    @property
    def simulated(self) -> bool:
        """Tell whether nobody measured it."""
        return bool(self.document.simulated)

    @property
    def sentence(self) -> str:
        """Return the entry in words."""
        said = f"SIMULATED: {self._finding}" if self.simulated else self._finding
        if (w := self.withdrawn) is None:
            return said
        return f"WITHDRAWN on {w.date.isoformat()}{f' by {w.by}' if w.by else ''}: {w.reason} ({said})"

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

    @property
    def valid_entries(self) -> tuple[RecordEntry, ...]:
        """Those that were not withdrawn: what the robot is judged by."""
        return tuple(e for e in self.entries if e.withdrawn is None)

    @classmethod
    def read(cls, folder: Path) -> "RobotRecord":
        """Read a record.

        Raises:
            InputError: it is none, or a document is not what was added.
        """
        file = read_toml(folder / "record.toml", RecordFile)
        found = sorted(p for p in (folder / "entries").glob("[0-9]*-*") if p.is_dir())
        entries = sorted(map(_read_entry, found), key=lambda e: (e.file.circumstances.date, e.number))
        other = next((e for e in entries if e.document.robot != file.robot and e.withdrawn is None), None)
        if other is not None:
            raise InputError(
                f"{folder / 'record.toml'} is the record of {file.robot}, but entry {other.number} is of "
                f"{other.document.robot}: one of them was changed; fetch it from a backup"
            )
        return cls(file, tuple(entries))

    @property
    def is_mistake(self) -> bool:
        """Tell whether the serial number was withdrawn, and nothing that counts was added since."""
        return self.file.withdrawn is not None and not self.valid_entries

    @property
    def simulated(self) -> bool:
        """Tell whether nobody has measured this robot: there is none."""
        return any(e.simulated for e in self.valid_entries)

    @property
    def next_check(self) -> date | None:
        """Day of the next check: after a failed one its own day, as it is due at once."""
        if self.failure is not None:
            return self.failure[0]
        days = [e.file.circumstances.date for e in self.valid_entries if e.file.kind != "validation"]
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
        last = next((e for e in self.valid_entries[::-1] if e.file.kind != "validation"), None)
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
        return tuple(e.file.circumstances.date for e in self.valid_entries if e.file.kind == "calibration")

    @property
    def checks(self) -> tuple[tuple[date, CheckFile], ...]:
        """Every check with its day."""
        found = ((e.file.circumstances.date, e.document) for e in self.valid_entries)
        return tuple((day, document) for day, document in found if isinstance(document, CheckFile))

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
        found = [(e.number, e.document) for e in self.valid_entries if isinstance(e.document, Identification)]
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
    said = folder / WITHDRAWN
    withdrawn = validate(read_json(said), Withdrawal, str(said)) if said.is_file() else None
    return RecordEntry(int(folder.name.partition("-")[0]), file, read_document(path, file.kind), withdrawn)


def read_document(path: Path, kind: EntryKind) -> RecordedDocument:
    """Read the document of an entry of a kind.

    Raises:
        InputError: it is none.
    """
    if kind == "calibration":
        return Identification.read(path)
    if kind == "check":
        return validate(read_json(path), CheckFile, str(path))
    return validate(read_json(path), AccuracyFile, str(path))


class OpcUaModel(BaseModel):
    """An object whose values stand under their BrowseNames."""

    model_config = ConfigDict(frozen=True, alias_generator=to_pascal, populate_by_name=True, serialize_by_alias=True)


class OpcUaDevice(OpcUaModel):
    """Properties of a ``MotionDeviceType``."""

    serial_number: str
    model: str


class OpcUaPrognosis(OpcUaModel):
    """Properties of a ``CalibrationPrognosisType``; what is unknown is null."""

    predicted_time: datetime | None
    calibrated: bool
    date_of_calibration: datetime | None
    calibration_interval: float
    calibration_certificate: tuple[str, ...]


class OpcUaRecord(OpcUaModel):
    """Both with their types, and the error of the tool to be expected [mm], which no companion specification has."""

    device_type: str = "http://opcfoundation.org/UA/Robotics/;MotionDeviceType"
    device: OpcUaDevice
    prognosis_type: str = "http://opcfoundation.org/UA/GMS/;CalibrationPrognosisType"
    prognosis: OpcUaPrognosis
    expected_tool_error_mm: float | None


def map_to_opcua(record: RobotRecord) -> OpcUaRecord:
    """Return the record as OPC UA values, times at the beginning of the day (UTC).

    Where a check has failed the robot is not calibrated, and the predicted time is that of the check.
    """
    found = [(e.file.circumstances, e.document) for e in record.valid_entries if isinstance(e.document, Identification)]
    prognosis = OpcUaPrognosis(
        predicted_time=_begin(record.next_check),
        calibrated=record.calibration_date is not None,
        date_of_calibration=_begin(found[-1][0].date) if found else None,
        calibration_interval=record.file.check_days * 86_400_000.0,  # OPC UA counts a Duration in ms
        calibration_certificate=tuple(c.certificate for c, _ in found[-1:] if c.certificate),
    )
    device = OpcUaDevice(serial_number=record.file.serial, model=record.file.robot)
    error = float(to_mm(found[-1][1].workspace_error)) if found else None
    return OpcUaRecord(device=device, prognosis=prognosis, expected_tool_error_mm=error)


def _begin(day: date | None) -> datetime | None:
    return None if day is None else datetime.combine(day, time(), UTC)
