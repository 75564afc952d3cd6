"""The pages for the person at the cell: rendered here, brought to life by small scripts that come with the package."""

import json
import logging
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Annotated, get_args

from fastapi import APIRouter, FastAPI, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from planner.cell.reading import load_cell, shipped_cells
from planner.checks.record import CheckedChange, CheckFile
from planner.circular.document import CircularDocument
from planner.common.errors import InputError
from planner.common.files import read_utf8
from planner.common.schema import read_json
from planner.documents.baseline import NAME as BASELINE
from planner.model.identification_document import Identification
from planner.report.page import embed_charts, embed_report, embed_still
from planner.service.answers import Job
from planner.service.context import Context, ServiceContext, at_one_moment
from planner.service.declared_request import typed_options
from planner.service.file_api import describe_cell, dialect_entries, robot_entries
from planner.service.guards import EMBEDDING_POLICY
from planner.service.job_api import output_path
from planner.service.job_folder import JobId, Sha256
from planner.service.job_record import JobFilter, State
from planner.service.job_requests import REQUESTS
from planner.service.page_content import (
    PLANS,
    CheckForecastFile,
    correction_text,
    is_simulated,
    plan_facts,
    read_plan_document,
    visible_files,
)
from planner.service.problems import ERRORS, problem_of
from planner.service.record_api import find_calibration, find_record_entry
from planner.service.record_index import RecordedEntry, RobotFilter
from planner.service.rendering import ENVIRONMENT, render
from planner.session.document import PlanDocument, PlanHeader

LOG = logging.getLogger("edbb.service")


@dataclass(frozen=True)
class OwnCell:
    """A cell that was sent: its identifier, what it is called, and the files that it names, as JSON."""

    id: str
    title: str
    files: str


@dataclass(frozen=True)
class PlanChoice:
    """A plan whose log may be dropped; ``baseline``: the job that calibrated what a check is held against."""

    job: Job
    plan_id: str
    is_check: bool
    baseline: str | None


SerialQuery = Annotated[str, Query(max_length=61, description="of the robot")]
PAGES = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


ENVIRONMENT.globals["typed_options"] = typed_options


def add_problem_handlers(app: FastAPI) -> None:
    """Let every error leave ``app`` as a problem: a program reads it as JSON, a person as a page."""

    def answer(request: Request, err: Exception) -> Response:
        """Answer a failure as a page or as JSON, by what was asked for."""
        problem = problem_of(err)
        if problem.status_code == 500:
            LOG.error("%s %s", request.method, request.url.path, exc_info=err)
        if request.url.path.startswith(("/api/", "/static/")):
            return problem
        if isinstance(err, RequestValidationError) and request.method == "GET":
            return render("problem", 404, detail="There is no such page.")
        return render("problem", problem.status_code, detail=f"{problem.detail[:1].upper()}{problem.detail[1:]}.")

    for kind in ERRORS:
        app.add_exception_handler(kind, answer)


@PAGES.get("/jobs")
@at_one_moment
def show_jobs(context: Context) -> HTMLResponse:
    """All jobs that a person looks for."""
    kinds = [kind for kind, request in REQUESTS.items() if not (request.task or request.in_service)]
    people = context.jobs.list_people()
    return render("jobs", kinds=kinds, states=get_args(State), models=[r.name for r in robot_entries()], people=people)


@PAGES.get("/cells/{robot}/{cell}")
def show_cell(robot: str, cell: str) -> HTMLResponse:
    """A shipped cell in 3D, and the form that starts a plan."""
    name = f"{robot}/{cell}"
    if name not in shipped_cells():
        return render("problem", 404, detail=f"There is no shipped cell {name}.")
    return render("cell", cell=name, title=name, note="", own=False, files="[]", dialects=dialect_entries())


@PAGES.get("/cells/{cell}")
@at_one_moment
def show_own_cell(cell: Sha256, check: JobId, context: Context) -> HTMLResponse:
    """An uploaded cell, with the files that it was checked with."""
    job, file = context.jobs.get(check), context.uploads.find(cell)
    request = json.loads(job.request)
    if file is None or request.get("cell") != cell:
        return render("problem", 404, detail="There is no such cell.")
    named, files = describe_cell(context, file), json.dumps(request["files"])
    return render(
        "cell", cell=cell, title=named.name, note=named.note, own=True, files=files, dialects=dialect_entries()
    )


@PAGES.get("/jobs/{id}")
@at_one_moment
def show_job(id: JobId, context: Context) -> HTMLResponse:
    """A job: its progress, and its result once it has one."""
    job = context.show(id)
    document = REQUESTS[job.kind].document
    if job.state == "done" and document and document not in {f.name for f in job.files}:
        return _show_any(context, job)
    show = SHOWN.get(job.kind, _show_any)
    try:
        return show(context, job)
    except (ValidationError, InputError) as err:  # a version that wrote other documents
        LOG.warning("%s %s cannot be shown: %s", job.kind, id, err)
        return _show_any(context, job)


def _show_any(context: ServiceContext, job: Job) -> HTMLResponse:
    files = visible_files(job)
    report = any(f.name == "report.html" for f in files)
    shown = {"report": report, **_record_form(context, job)}
    return _with_charts(render("job", job=job, files=files, charts=_charts(context, job), **shown))


def _show_plan(context: ServiceContext, job: Job) -> HTMLResponse:
    """A plan, of a check too: what it is for, where it drives, and the files to take along."""
    plan = read_plan_document(context, job) if job.state == "done" else None
    names = {p.file for p in plan.programs} if plan else set()
    files, reports = visible_files(job), _reports(context, job)
    check = None
    if job.kind == "check-plan" and plan:
        check = CheckForecastFile.model_validate(read_json(output_path(context, job.id, "shows.json")))
    page = render(
        "plan",
        job=job,
        files=[f for f in files if f.name not in names],
        programs=[f for f in files if f.name in names],
        charts=embed_charts(*reports) if reports else "",
        still="".join(map(embed_still, reports)),
        report=any(f.name == "report.html" for f in files),
        facts=plan_facts(plan, job.kind == "check-plan") if plan else [],
        notes=list(dict.fromkeys(plan.notes)) if plan else (),
        is_circular=isinstance(plan, CircularDocument),
        foreseen=not isinstance(plan, PlanDocument) or bool(plan.foresight and plan.foresight.after_mm),
        check=check,
        baseline=find_calibration(context, job.id) if check else None,
        dialects=dialect_entries(),
        others=[o for o in _plans(context, job.kind) if o.id != job.id],
    )
    return _with_charts(page)


def _charts(context: ServiceContext, *jobs: Job) -> str:
    """Return the charts of a job's report, or those that two reports have in common."""
    pages = _reports(context, *jobs)
    return embed_charts(*pages) if len(pages) == len(jobs) else ""


def _reports(context: ServiceContext, *jobs: Job) -> list[str]:
    return [read_utf8(context.files.path(f.sha256)) for job in jobs for f in job.files if f.name == "report.html"]


def _with_charts(page: HTMLResponse) -> HTMLResponse:
    """Let a page show charts of a report, which have styles of their own."""
    page.headers["content-security-policy"] = EMBEDDING_POLICY
    return page


def _show_calibration(context: ServiceContext, job: Job) -> HTMLResponse:
    """A calibration: its report as the file shows it, and what the service knows of the robot."""
    outputs, shown = {f.name: context.files.path(f.sha256) for f in job.files}, dict[str, object](report="")
    if job.state == "done":
        document = Identification.read(outputs["identification.json"])
        shown |= {"more": document.more, "standing": context.judge.standing(job.id)}
    if "report.html" in outputs:
        shown["report"] = embed_report(read_utf8(outputs["report.html"]))
    baseline = BASELINE in outputs
    checks = [c for c in _plans(context, "check-plan") if find_calibration(context, c.id) == job.id] if baseline else []
    shown |= {"baseline": baseline, "checks": checks, "files": visible_files(job), **_record_form(context, job)}
    return _with_charts(render("calibration", job=job, **shown))


@PAGES.get("/compare")
@at_one_moment
def compare_plans(first: JobId, second: JobId, context: Context) -> HTMLResponse:
    """Two finished plans side by side: their figures, and their charts in pairs."""
    jobs = [context.show(id) for id in (first, second)]
    if any(j.kind not in PLANS or j.state != "done" for j in jobs):
        return render("problem", 404, detail="Only two finished plans can be compared.")
    plans = [read_plan_document(context, j) for j in jobs]
    facts = [plan_facts(p, j.kind == "check-plan") for p, j in zip(plans, jobs, strict=True)]
    names = list(dict.fromkeys(what for each in facts for what, _ in each))
    rows = [(what, [[v for w, v in each if w == what] for each in facts]) for what in names]
    rows.append(("to know", [list(dict.fromkeys(p.notes)) for p in plans]))
    return _with_charts(render("compare", plans=jobs, rows=rows, charts=_charts(context, *jobs)))


@PAGES.get("/calibrate")
@at_one_moment
def show_calibrate(context: Context, plan: JobId | None = None, serial: SerialQuery = "") -> HTMLResponse:
    """The form that takes the log of a run."""
    latest = [p for kind in PLANS for p in _plans(context, kind)]
    if plan is not None and plan not in {p.id for p in latest}:
        latest.insert(0, context.show(plan))  # however old it is, its page has led here
    planned = [(p, _plan_header(context, p)) for p in latest if p.kind in PLANS and p.state == "done"]
    rows = [
        PlanChoice(p, h.plan_id, p.kind == "check-plan", find_calibration(context, p.id))
        for p, h in planned
        if h is not None and not h.kind
    ]
    cells, shipped = _own_cells(context), _columns_of_shipped_cells()
    known = {"plans": rows, "chosen": plan, "cells": cells, "shipped": shipped, "robots": robot_entries()}
    return render("calibrate", serial=serial, **known)


def _show_check(context: ServiceContext, job: Job) -> HTMLResponse:
    """A check: passed or failed, and what to do."""
    check = None
    if job.state == "done":
        check = CheckFile.model_validate(read_json(output_path(context, job.id, "check.json")))
        check = check.model_copy(update={"changes": sorted(check.changes, key=_change_order)})
    baseline = find_calibration(context, job.id)
    form = _record_form(context, job, baseline)
    robot = job.robot if check is None else check.robot
    return render("check", job=job, robot=robot, files=visible_files(job), check=check, baseline=baseline, **form)


def _show_correction(context: ServiceContext, job: Job) -> HTMLResponse:
    """A corrected program: what is to be expected of it, what to know, and the files."""
    expected, text = correction_text(context, job) if job.state == "done" else ("", "")
    known = job.request.get("model")
    model = context.show(known) if known else None
    simulated = model is not None and is_simulated(context, model)
    shown = {"expected": expected, "text": text, "files": visible_files(job)}
    return render("correction", job=job, model=model, simulated=simulated, **shown)


def _change_order(change: CheckedChange) -> tuple[int, str]:
    """Zeros joint by joint, then gears, then the rest."""
    kinds = ("zero of", "gear of")
    return next((k for k, kind in enumerate(kinds) if change.change.startswith(kind)), len(kinds)), change.change


def _record_form(context: ServiceContext, job: Job, calibration: str | None = None) -> dict[str, object]:
    """What the form shows: where the result is in a record already, and what the record of its calibration knows."""
    before, simulated = calibration or find_calibration(context, job.id) or job.id, is_simulated(context, job)
    own, recorded = find_record_entry(context, job.id), find_record_entry(context, before)
    if recorded.simulated != simulated:
        recorded = RecordedEntry()  # a simulated robot is not in the record of a real one
    # 200: serial numbers that are offered
    serials = [r.serial for r in context.records.index.list_robots(RobotFilter(simulated=simulated), 200)]
    plan = job.request.get("plan")
    sessions = [s.serial for s in context.sessions.list_sessions(plan=plan)] if plan else []
    serial = next((s for s in sessions if s), "") if len(set(sessions)) == 1 else ""
    return {"own": own, "recorded": recorded, "serials": serials, "serial": serial, "simulated": simulated}


def _plans(context: ServiceContext, kind: str = "plan") -> list[Job]:
    """The finished plans, the latest first."""
    done = context.describe_all(context.jobs.list_jobs(JobFilter(kind, "done")))
    return [j for j in done if any(f.name == REQUESTS[kind].document for f in j.files)]


def _plan_header(context: ServiceContext, job: Job) -> PlanHeader | None:
    """What a plan says of itself; nothing of one that cannot be read: another version wrote it."""
    try:
        return _read_header(output_path(context, job.id, "plan.json"))
    except (ValidationError, InputError, HTTPException) as err:  # or just deleted
        LOG.warning("plan %s cannot be read: %s", job.id, err)
        return None


@cache
def _read_header(path: Path) -> PlanHeader:
    """Content-addressed, so read once."""
    return PlanHeader.model_validate(read_json(path))


def prepare_pages() -> None:
    """Read what pages of all people show, so that the first who opens one does not wait for it."""
    robot_entries()
    dialect_entries()
    _columns_of_shipped_cells()


@cache
def _columns_of_shipped_cells() -> dict[str, str]:
    """Return every shipped cell with the columns that its gauge gives."""
    return {name: load_cell(name, planning=False).gauge.columns for name in shipped_cells()}


def _own_cells(context: ServiceContext) -> list[OwnCell]:
    """The cells that were sent and could be read, the latest first, with the files that they name."""
    checked: dict[str, OwnCell] = {}
    for job in context.jobs.list_jobs(JobFilter("cell-check", "done")):
        request = json.loads(job.request)
        if "/" not in request["cell"]:
            name = context.cells.find(request["cell"]).title or job.title
            title = f"{name}, {datetime.fromtimestamp(job.created, UTC):%Y-%m-%d %H:%M} UTC"
            checked.setdefault(request["cell"], OwnCell(request["cell"], title, json.dumps(request["files"])))
    return list(checked.values())


SHOWN = {
    **dict.fromkeys(PLANS, _show_plan),
    "identification": _show_calibration,
    "check": _show_check,
    "compensation": _show_correction,
}
"""How jobs of a kind are shown that are more than their files."""
