"""The pages of robots: all of them, one with its history, its certificates, and the correction of its programs."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from planner.documents.baseline import NAME as BASELINE
from planner.model.identification_document import Identification
from planner.model.use_text import TOOLS, bound_text
from planner.service.certificate import REGIONS, STATED, certificate_numbers, model_errors
from planner.service.certificate_api import address_here, find_certificate
from planner.service.context import Context, ServiceContext, at_one_moment
from planner.service.file_api import robot_entries, robot_title
from planner.service.job_folder import JobId
from planner.service.job_record import JobFilter
from planner.service.page_content import is_simulated
from planner.service.record_api import RecordHistory, Serial, describe_record, find_record_entry
from planner.service.record_index import RobotFilter
from planner.service.rendering import render
from planner.service.session_store import CellSession

ROBOT_PAGES = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@dataclass(frozen=True)
class RobotEvent:
    """Something of a robot that has a page; ``fault``: why it counts no more."""

    at: datetime
    kind: str
    url: str
    text: str
    fault: str = ""


@ROBOT_PAGES.get("/")
@at_one_moment
def show_start(
    context: Context, q: Annotated[str, Query(max_length=200)] = "", after: Annotated[str, Query(max_length=120)] = ""
) -> HTMLResponse:
    """The robots of this plant with their states, those that ship with cells, and what was done lately."""
    most = 50  # of a plant on the first page
    changed = context.judge.unrecorded_changes()
    found = context.records.index.list_robots(RobotFilter(q), most + 1, after, changed)
    return render(
        "start",
        robots=robot_entries(),
        title_of=robot_title,
        records=found[:most],
        known=context.records.index.count(),
        q=q,
        after=after,
        more=found[most - 1].place if len(found) > most else None,
    )


@ROBOT_PAGES.get("/robots/{serial}")
@at_one_moment
def show_robot(serial: Serial, context: Context) -> HTMLResponse:
    """The record of a robot: how it stands, its drift, its history."""
    record = describe_record(context, context.records.read(serial))
    counted = [e for e in record.history if e.withdrawn is None]
    last = next((e.job for e in counted[::-1] if e.kind == "calibration"), None)
    known = last is not None and any(o.name == BASELINE for o in context.jobs.outputs(last))
    return render(
        "robot",
        record=record,
        events=_robot_events(context, record),
        standing=None if last is None else context.judge.standing(last),
        model=robot_title(record.robot),
        cells=next((r.cells for r in robot_entries() if r.name == record.robot), []),
        calibration=last,
        counted=len(counted),
        baseline=last if known else None,
        simulated=record.simulated,
    )


def _robot_events(context: ServiceContext, record: RecordHistory) -> list[RobotEvent]:
    """All that was done to a robot beside its record's entries: sessions, corrected programs, certificates."""
    found = [
        RobotEvent(s.begun_at, "session", f"/sessions/{s.id}", _session_text(context, s))
        for s in context.sessions.list_sessions(record.serial)
    ]
    for number in reversed(record.certificates):
        c = find_certificate(context, number)
        text = f"{number}, {c.certificate.use}: U = {c.certificate.expanded_text}"
        found.append(RobotEvent(c.certificate.issued, "certificate", f"/certificates/{number}", text, c.fault))
    for job in context.describe_all(context.jobs.list_jobs(JobFilter("compensation", "done", text=record.serial))):
        if job.serial == record.serial:
            despite = ", although the robot had changed" if job.request.get("despite_change") else ""
            text = f"{job.title}: {job.verdict}{despite}"
            found.append(RobotEvent(job.created, "corrected program", f"/jobs/{job.id}", text))
    return sorted(found, key=lambda e: e.at, reverse=True)


def _session_text(context: ServiceContext, session: CellSession) -> str:
    people, ticks = context.sessions.people(session), context.sessions.list_ticks(session.id)
    who = f"by {', '.join(people)}, " if people else ""
    return f"{who}{sum(t.done for t in ticks)} steps ticked{', ended' if session.ended else ''}"


@ROBOT_PAGES.get("/jobs/{id}/certificate")
@at_one_moment
def show_issue(id: JobId, context: Context, request: Request) -> HTMLResponse:
    """The certificates of a calibration, and the form that issues one."""
    job = context.show(id)
    if job.kind != "identification" or job.state != "done":
        return render("problem", 404, detail="Only a finished calibration has a certificate.")
    outputs = {f.name: f.sha256 for f in job.files}
    document = Identification.read_usable(context.files.path(outputs["identification.json"]))
    recorded = find_record_entry(context, id)
    numbers = certificate_numbers(context.records.path(recorded.serial)) if recorded.serial else []
    states_run = document.release is not None and document.release.where_measured is not None
    return render(
        "issue",
        job=job,
        simulated=is_simulated(context, job),
        recorded=recorded,
        issued=[c for n in numbers if (c := find_certificate(context, n)).certificate.job == id],
        errors={TOOLS[tool]: (tool, bound_text(bound)) for tool, (bound, _) in model_errors(document).items()},
        regions={k: v for k, v in REGIONS.items() if k != "run" or states_run},
        stated=STATED,
        address=address_here(request),
    )


@ROBOT_PAGES.get("/jobs/{id}/correct")
@at_one_moment
def show_correct(id: JobId, context: Context) -> HTMLResponse:
    """The form that corrects a program by a calibration."""
    job = context.show(id)
    if job.kind != "identification" or job.state != "done":
        return render("problem", 404, detail="Only a finished calibration corrects programs.")
    return render("correct", job=job, simulated=is_simulated(context, job))
