"""Routes of the records of robots: begun, added to, entries withdrawn; state and next check, history, drift, export."""

import math
from datetime import date
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi import Path as InPath
from pydantic import Field

from planner.checks.record import (
    DOCUMENTS,
    AxisDrift,
    Circumstances,
    EntryKind,
    OpcUaRecord,
    RobotRecord,
    Withdrawal,
    map_to_opcua,
)
from planner.common.schema import SEEN, ReasonText, StrictModel
from planner.service.callers import CALLER
from planner.service.certificate import certificate_numbers
from planner.service.context import Context, ServiceContext
from planner.service.job_api import LIST_MOST, next_link
from planner.service.job_folder import EverySystem, JobId
from planner.service.record_index import (
    PLACE,
    UNRECORDED,
    RecordedEntry,
    RecordSummary,
    RobotFilter,
    RobotState,
    robot_advice,
    robot_state,
    state_line,
)

RECORDS = APIRouter(prefix="/api", tags=["records"])
SERIAL = "^[A-Za-z0-9]([A-Za-z0-9._-]{0,59}[A-Za-z0-9_-])?$"
Serial = Annotated[str, InPath(pattern=SERIAL, description="serial number", examples=["KR6-0815"]), EverySystem]
SerialText = Annotated[str, Field(pattern=SERIAL, description="serial number", examples=["KR6-0815"]), EverySystem]


EntryNumber = Annotated[int, InPath(ge=1, le=99_999, description="of the entry", examples=[3])]


class Reason(StrictModel):
    """Why something is withdrawn."""

    reason: Annotated[ReasonText, Field(examples=["serial number mistyped"])]

    @property
    def withdrawal(self) -> Withdrawal:
        """The withdrawal, of whoever asks, today."""
        return Withdrawal(reason=self.reason, by=CALLER.get().name, date=date.today())


class HistoryEntry(StrictModel):
    """What was done to a robot, what came of it, and what differs from the calibration before by more than 3 σ."""

    number: int
    kind: EntryKind
    result: str
    simulated: bool
    changed: list[str]
    circumstances: Circumstances
    withdrawn: Withdrawal | None = Field(description="why it counts no more; none where it does")
    job: str | None = Field(description="where its files are; none of an entry that came otherwise")


class DriftLine(StrictModel):
    """One number at each check."""

    name: str
    values: list[float | None]
    std: list[float | None]


class RecordHistory(RecordSummary):
    """The history of a robot: entries, the oldest first, and by its checks the drift."""

    line: str = Field(description="how it stands, in one line", examples=["good until 2026-12-28"])
    history: list[HistoryEntry]
    certificates: list[str] = Field(description="numbers of the certificates that were issued, the oldest first")
    check_days: list[date] = Field(description="days of the checks")
    drift_mm: list[DriftLine] = Field(description="zero of each axis, as motion of the tool if it alone had moved")
    beyond_chance: list[float] = Field(description="decades; above zero something has changed")


class EntryRequest(StrictModel):
    """What is added to a record: the results of a job, and who measured, when and with what."""

    job: JobId
    circumstances: Circumstances


class NewRobot(StrictModel):
    """A robot that was never measured."""

    robot: Annotated[str, Field(max_length=100, pattern=SEEN, examples=["kuka-kr6-r700"], description="its model")]


class RobotPage(StrictModel):
    """Which robots a page of the list holds."""

    q: str = Field("", max_length=200, description="text that serial number or model has")
    robot: Annotated[str, Field(max_length=100)] | None = Field(None, description="model of the robot")
    state: RobotState | None = None
    most: int = Field(100, ge=1, le=LIST_MOST)
    after: str = Field("", pattern=f"^({PLACE})?$", description="where the page before ended, of its Link header")


@RECORDS.get("/records")
def list_records(
    context: Context, request: Request, response: Response, page: Annotated[RobotPage, Query()]
) -> list[RecordSummary]:
    """List the robots that have a record, those in need first; the header ``Link`` leads to the next page."""
    wanted = RobotFilter(page.q, page.robot, page.state)
    changed = context.judge.unrecorded_changes()
    found = context.records.index.list_robots(wanted, page.most + 1, page.after, changed)
    if len(found) > page.most:
        response.headers["link"] = next_link(request, found[page.most - 1].place)
    return found[: page.most]


@RECORDS.get("/records/{serial}")
def get_record(serial: Serial, context: Context) -> RecordHistory:
    """Get the history of a robot."""
    return describe_record(context, context.records.read(serial))


@RECORDS.post("/records/{serial}/entries", status_code=201)
def add_to_record(serial: Serial, request: EntryRequest, context: Context) -> RecordHistory:
    """Add a calibration, validation or check to a robot's record; the same again changes nothing."""
    context.records.index.refresh()
    with context.jobs.at_one_moment():
        job = context.jobs.get(request.job)
        known = find_calibration(context, job.id)
        judged = find_record_entry(context, known) if known else RecordedEntry()
    return describe_record(context, context.records.add(serial, job, request.circumstances, judged))


@RECORDS.put("/records/{serial}")
def begin_record(serial: Serial, request: NewRobot, context: Context) -> RecordHistory:
    """Begin the record of a robot that was never measured, or bring back a withdrawn one; another stays as it is."""
    return describe_record(context, context.records.begin(serial, request.robot))


@RECORDS.post("/records/{serial}/withdrawal")
def withdraw_robot(serial: Serial, request: Reason, context: Context) -> RecordHistory:
    """Withdraw a serial number that has no entry that counts: it was a mistake; an entry brings it back."""
    return describe_record(context, context.records.withdraw(serial, None, request.withdrawal))


@RECORDS.post("/records/{serial}/entries/{number}/withdrawal")
def withdraw_entry(serial: Serial, number: EntryNumber, request: Reason, context: Context) -> RecordHistory:
    """Withdraw an entry with a reason: it stays in the history and counts no more."""
    return describe_record(context, context.records.withdraw(serial, number, request.withdrawal))


@RECORDS.get("/records/{serial}/opcua")
def get_opcua(serial: Serial, context: Context) -> OpcUaRecord:
    """Get a robot's record as values of OPC UA: a calibration's prognosis (OPC 40210)."""
    return map_to_opcua(context.records.read(serial))


@RECORDS.get("/records/{serial}/export", response_class=Response)
def export_record(serial: Serial, context: Context) -> Response:
    """Get the whole folder of a record as ZIP, as ``edbb record`` reads it."""
    headers = {"content-disposition": f'attachment; filename="{serial}.zip"'}
    return Response(context.records.pack(serial), media_type="application/zip", headers=headers)


def find_record_entry(context: ServiceContext, job: str) -> RecordedEntry:
    """Return the entry of a record that the result of a job is."""
    return context.records.index.find_entry({o.sha256 for o in context.jobs.outputs(job) if o.name in DOCUMENTS})


def find_calibration(context: ServiceContext, id: str) -> str | None:
    """Return the job that calibrated what a check, its plan or a validation is held against; none of one elsewhere."""
    command = context.jobs.get(id).command
    calibrated = command.calibrated_inputs()
    known = calibrated.get("identification.json") or calibrated.get("robot.toml")
    made = context.jobs.writer(known, "identification") if known else None
    return made.id if made else None


def describe_record(context: ServiceContext, record: RobotRecord) -> RecordHistory:
    """Return a record as the interface shows it."""
    jobs = context.jobs.jobs_by_output([e.file.document_sha256 for e in record.entries])
    moved = list(record.differences())
    state, line, advice = robot_state(record), state_line(record), robot_advice(record)
    if changed := context.judge.unrecorded_changes().get(record.file.serial):
        state, advice = "changed", UNRECORDED
        line = f"changed{f': {changed.check.cause}' if changed.check.cause else ''}"
    history = [
        HistoryEntry(
            number=e.number,
            kind=e.file.kind,
            result=e.sentence,
            simulated=e.simulated,
            changed=[text for number, text in moved if number == e.number],
            circumstances=e.file.circumstances,
            withdrawn=e.withdrawn,
            job=jobs.get(e.file.document_sha256),
        )
        for e in record.entries
    ]
    return RecordHistory(
        serial=record.file.serial,
        robot=record.file.robot,
        state=state,
        advice=advice,
        next_check=record.next_check,
        due=record.due_text,
        entries=len(record.entries),
        simulated=record.simulated,
        line=line,
        certificates=certificate_numbers(context.records.path(record.file.serial)),
        history=history,
        check_days=[when for when, _ in record.checks],
        drift_mm=[_drift_line(d) for d in record.drifts],
        beyond_chance=[check.decades for _, check in record.checks],
    )


def _drift_line(drift: AxisDrift) -> DriftLine:
    values, std = ([_finite_or_none(v) for v in column] for column in zip(*drift.motions, strict=True))
    return DriftLine(name=drift.name, values=values, std=std)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
