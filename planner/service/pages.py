"""The pages for the person at the cell: rendered here, brought to life by small scripts that come with the package."""

import hmac
import json
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Annotated

import jinja2
from fastapi import APIRouter, FastAPI, Form, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.exceptions import HTTPException

from planner import __version__
from planner.cell.file import CellFile
from planner.cell.reading import shipped_cells
from planner.common.schema import read_json, read_toml
from planner.identification.baseline import NAME as BASELINE
from planner.instruments.record import CheckedChange, CheckFile
from planner.service.answers import Job, OutputFile, describe_job
from planner.service.certificate import build_certificate
from planner.service.context import Context, ServiceContext
from planner.service.guards import COOKIE, is_secure, session_cookie
from planner.service.job_api import find_job, find_output
from planner.service.job_requests import JobId, Sha256
from planner.service.list_api import dialect_entries, robot_entries, robot_title
from planner.service.page_content import is_simulated, pictures, plan_facts, read_calibration, visible_files
from planner.service.problems import http_problem, request_problem
from planner.service.record_api import RecordSummary, Serial, describe_record, find_record, find_recorded, list_records
from planner.service.record_store import RecordedEntry
from planner.session.document import PlanDocument, PlanHeader


@dataclass(frozen=True)
class SessionStep:
    """One step, and the files that it needs."""

    title: str
    text: str
    files: tuple[OutputFile, ...] = ()


def session_steps(plan: PlanDocument, cell: CellFile, files: list[OutputFile]) -> list[SessionStep]:
    """Return the steps from an empty cell to a saved log, in order."""
    minutes = f"{plan.trajectory.duration_s / 60:.0f} minutes" if plan.trajectory else "a while"
    return [
        SessionStep(
            "Clear the cell",
            "Nobody and nothing stands within reach that the cell file does not name. Keep the stop at hand.",
        ),
        SessionStep("Switch off what corrects", "Accuracy options of the controller are off."),
        SessionStep(
            "Bring the program to the controller",
            f"It bears the plan {plan.plan_id} in its first lines.",
            _programs(plan, files),
        ),
        SessionStep("Fixture and tool", _places(cell)),
        SessionStep("Warm up", "Drive for half an hour as in work, so that the robot is as warm as when it works."),
        SessionStep(
            "Drive to the start slowly",
            "Run the first move at low override and watch: the way from where the robot stands to home is not planned.",
        ),
        *_attach(cell),
        SessionStep("Start the log", _log_text(cell)),
        SessionStep("Run the program", f"It drives for {minutes} through {len(plan.poses)} poses. Stay beside it."),
        SessionStep("Save the log", f"As CSV, with the line '# plan_id: {plan.plan_id}' above the columns."),
    ]


def _programs(plan: PlanDocument, files: list[OutputFile]) -> tuple[OutputFile, ...]:
    """The programs of the plan, with the files that go with them."""
    stems = {Path(p["file"]).stem for p in plan.programs}
    return tuple(f for f in files if any(f.name.startswith(s) for s in stems))


def _places(cell: CellFile) -> str:
    where = "; ".join(f"{f.name or 'A'} at {_numbers(f.position_mm)} mm" for f in cell.fixtures)
    fixture = f"Fixture {where} in the base frame, to about 1 mm. " if where else ""
    tool = f"Measured point at {_numbers(cell.tool.map_mm)} mm in the flange. " if cell.tool else ""
    return f"{fixture}{tool}Balls and magnets are clean, everything is tight."


def _attach(cell: CellFile) -> list[SessionStep]:
    if not cell.fixtures:
        return []
    zero = "Set it to zero as the program asks." if cell.gauge.zero == "free" else "Check its known zero."
    return [SessionStep("Attach the gauge", f"Where the program pauses: put both balls into their cups. {zero}")]


def _log_text(cell: CellFile) -> str:
    reading = "the gauge's length" if cell.fixtures else "the gauge's reading"
    return (
        f"One row a {'pose' if cell.motion.measure == 'static' else 'sample'}: time, joint angles as read, {reading}."
    )


def _numbers(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:g}" for v in values)


FOLDER = Path(__file__).parent
STATIC = FOLDER / "static"
PAGES = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(FOLDER / "templates"),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.globals["version"] = __version__


def render(template: str, status: int = 200, /, **content: object) -> HTMLResponse:
    """Return a page."""
    return HTMLResponse(ENVIRONMENT.get_template(f"{template}.html.j2").render(**content), status)


def add_problem_pages(app: FastAPI) -> None:
    """Let what is wrong with the address of a page be told as a page."""

    @app.exception_handler(HTTPException)
    def of_http(request: Request, err: HTTPException) -> Response:
        if request.url.path.startswith(("/api/", "/static/")):
            return http_problem(err)
        return render("problem", err.status_code, detail=f"{str(err.detail).capitalize()}.")

    @app.exception_handler(RequestValidationError)
    def of_request(request: Request, err: RequestValidationError) -> Response:
        if request.url.path.startswith("/api/"):
            return request_problem(err)
        return render("problem", 404, detail="There is no such page.")


@PAGES.get("/")
def show_start(context: Context) -> HTMLResponse:
    """The robots of this plant with their states, those that ship with cells, and what was done lately."""
    return render("start", robots=robot_entries(), title_of=robot_title, records=_in_need_first(list_records(context)))


@PAGES.get("/robots/{serial}")
def show_robot(serial: Serial, context: Context) -> HTMLResponse:
    """The record of a robot: how it stands, its drift, its history."""
    record = describe_record(context, find_record(context, serial))
    last = next((e.job for e in record.history[::-1] if e.kind == "calibration"), None)
    known = last is not None and any(o.name == BASELINE for o in context.jobs.outputs(last))
    return render(
        "robot",
        record=record,
        model=robot_title(record.robot),
        baseline=last if known else None,
        simulated=record.simulated,
    )


@PAGES.get("/jobs")
def show_jobs() -> HTMLResponse:
    """All jobs."""
    return render("jobs")


@PAGES.get("/login")
def show_login() -> HTMLResponse:
    """The form that asks for the token."""
    return render("login", wrong=False)


@PAGES.post("/login")
def log_in(request: Request, context: Context, token: Annotated[str, Form(max_length=1000)] = "") -> Response:
    """Give a browser its cookie."""
    wanted = context.settings.token
    if not wanted or not hmac.compare_digest(token.encode(), wanted.encode()):
        return render("login", 401, wrong=True)
    answer = RedirectResponse("/", 303)
    answer.set_cookie(
        COOKIE, session_cookie(wanted), max_age=30 * 86400, httponly=True, samesite="strict", secure=is_secure(request)
    )
    return answer


@PAGES.get("/cells/{robot}/{cell}")
def show_cell(robot: str, cell: str) -> HTMLResponse:
    """A shipped cell in 3D, and the form that starts a plan."""
    name = f"{robot}/{cell}"
    if name not in shipped_cells():
        return render("problem", 404, detail=f"There is no shipped cell {name}.")
    return render("cell", cell=name, title=name, files="[]", dialects=dialect_entries())


@PAGES.get("/cells/{cell}")
def show_own_cell(cell: Sha256, check: JobId, context: Context) -> HTMLResponse:
    """An uploaded cell, with the files that it was checked with."""
    job, file = find_job(context, check), context.uploads.find(cell)
    request = json.loads(job.request)
    if file is None or request.get("cell") != cell:
        return render("problem", 404, detail="There is no such cell.")
    return render("cell", cell=cell, title=file.name, files=json.dumps(request["files"]), dialects=dialect_entries())


@PAGES.get("/jobs/{id}")
def show_job(id: JobId, context: Context) -> HTMLResponse:
    """A job: its progress, and its result once it has one."""
    job = _job(context, id)
    files, shown = visible_files(job), pictures(job)
    if job.kind == "plan" and not _is_circular(context, job):
        plan = _plan(context, job) if job.state == "done" else None
        names = {p["file"] for p in plan.programs} if plan else set()
        programs = [f for f in files if f.name in names]
        facts = plan_facts(plan) if plan else []
        others = [o for o in _plans(context) if o.id != id]
        also = {"dialects": dialect_entries(), "others": others}
        return render("plan", job=job, files=files, pictures=shown, facts=facts, programs=programs, **also)
    if job.kind == "identification":
        found = None
        if job.state == "done":
            found = read_calibration(context.files.path(find_output(context, id, "identification.json").sha256))
        baseline = any(f.name == BASELINE for f in job.files)
        checks = _check_plans(context, id) if baseline else []
        shown_too = {"baseline": baseline, "checks": checks, **_record_form(context, job)}
        return render("calibration", job=job, files=files, pictures=shown, found=found, **shown_too)
    if job.kind == "check":
        return _show_check(context, job, files)
    report = any(f.name == "report.html" for f in files)
    shown_too = {"report": report, **_record_form(context, job)}
    return render("job", job=job, files=files, pictures=shown, **shown_too)


@PAGES.get("/compare")
def compare_plans(first: JobId, second: JobId, context: Context) -> HTMLResponse:
    """Two finished plans side by side: their figures, and their charts in pairs."""
    jobs = [_job(context, id) for id in (first, second)]
    if any(j.kind != "plan" or j.state != "done" or _is_circular(context, j) for j in jobs):
        return render("problem", 404, detail="Only two finished plans of poses can be compared.")
    facts = [plan_facts(_plan(context, j)) for j in jobs]
    names = list(dict.fromkeys(what for each in facts for what, _ in each))
    rows = [(what, [[v for w, v in each if w == what] for each in facts]) for what in names]
    charts = [{p.caption: p for p in pictures(j)} for j in jobs]
    pairs = [[c[caption] for c in charts] for caption in charts[0] if caption in charts[1]]
    return render("compare", plans=jobs, rows=rows, pictures=pairs)


@PAGES.get("/jobs/{id}/session")
def show_session(id: JobId, context: Context) -> HTMLResponse:
    """What to do at the cell, as a checklist."""
    job = _job(context, id)
    if job.kind != "plan" or job.state != "done" or _is_circular(context, job):
        return render("problem", 404, detail="Only a finished plan of poses has a session.")
    plan = _plan(context, job)
    cell = read_toml(context.files.path(find_output(context, id, "cell.toml").sha256), CellFile)
    minutes = round(plan.trajectory.duration_s / 60) if plan.trajectory else 0
    return render("session", job=job, plan=plan, minutes=minutes, steps=session_steps(plan, cell, job.files))


@PAGES.get("/jobs/{id}/certificate")
def show_certificate(id: JobId, context: Context) -> HTMLResponse:
    """The certificate of a calibration, to print."""
    job = _job(context, id)
    if job.kind != "identification" or job.state != "done":
        return render("problem", 404, detail="Only a finished calibration has a certificate.")
    made = build_certificate(context, job)
    return render("certificate", job=job, **{f.name: getattr(made, f.name) for f in fields(made)})


@PAGES.get("/calibrate")
def show_calibrate(context: Context, plan: JobId | None = None) -> HTMLResponse:
    """The form that takes the log of a run."""
    checks = [describe_job(j, []) for j in context.jobs.list_jobs("check-plan") if j.state == "done"]
    rows = [
        {"id": p.id, "title": p.title, "created": f"{p.created:%Y-%m-%d %H:%M} UTC"}
        | {"plan_id": _plan_id(context, p), "baseline": p.request.get("identification", "")}
        for p in (*_plans(context), *checks)
    ]
    return render("calibrate", plans=rows, chosen=plan, cells=shipped_cells())


def _show_check(context: ServiceContext, job: Job, files: list[OutputFile]) -> HTMLResponse:
    """A check: passed or failed, and what to do."""
    check, plan = None, find_job(context, job.request["check_plan"])
    if job.state == "done":
        document = context.files.path(find_output(context, job.id, "check.json").sha256)
        check = CheckFile.model_validate(read_json(document))
        check = check.model_copy(update={"changes": sorted(check.changes, key=_change_order)})
    baseline = json.loads(plan.request)["identification"]
    form = _record_form(context, job, baseline)
    return render("check", job=job, files=files, check=check, baseline=baseline, **form)


def _change_order(change: CheckedChange) -> tuple[int, str]:
    """Zeros joint by joint, then gears, then the rest."""
    kinds = ("zero of", "gear of")
    return next((k for k, kind in enumerate(kinds) if change.change.startswith(kind)), len(kinds)), change.change


def _record_form(context: ServiceContext, job: Job, calibration: str | None = None) -> dict[str, object]:
    """What the form shows: where the result is in a record already, and what the record of its calibration knows."""
    before, simulated = calibration or job.request.get("model") or job.id, is_simulated(context, job)
    own, recorded = find_recorded(context, job.id), find_recorded(context, before)
    if recorded.simulated != simulated:
        recorded = RecordedEntry()  # a simulated robot is not in the record of a real one
    serials = [r.file.serial for r in context.records.list_records() if r.simulated == simulated]
    return {"own": own, "recorded": recorded, "serials": serials, "simulated": simulated}


def _in_need_first(records: list[RecordSummary]) -> list[RecordSummary]:
    return sorted(records, key=lambda r: (r.state == "good", str(r.next_check), r.serial))


def _plans(context: ServiceContext) -> list[Job]:
    """The finished plans, the latest first."""
    return [describe_job(j, []) for j in context.jobs.list_jobs("plan") if j.state == "done"]


def _plan_id(context: ServiceContext, job: Job) -> str:
    return _read_plan_id(context.files.path(find_output(context, job.id, "plan.json").sha256))


@cache
def _read_plan_id(path: Path) -> str:
    """Content-addressed, so read once."""
    return PlanHeader.model_validate(read_json(path)).plan_id


def _check_plans(context: ServiceContext, identification: str) -> list[dict[str, object]]:
    """The finished plans of checks against a calibration."""
    jobs = [describe_job(j, []) for j in context.jobs.list_jobs("check-plan") if j.state == "done"]
    mine = [j for j in jobs if j.request["identification"] == identification]
    return [{"id": j.id, "poses": j.request["poses"], "created": f"{j.created:%Y-%m-%d %H:%M} UTC"} for j in mine]


def _job(context: ServiceContext, id: str) -> Job:
    job = find_job(context, id)
    return describe_job(job, context.jobs.outputs(id) if job.ended else [])


def _is_circular(context: ServiceContext, job: Job) -> bool:
    return job.state == "done" and _header(context, job).kind == "circular"


def _header(context: ServiceContext, job: Job) -> PlanHeader:
    return PlanHeader.model_validate(_content(context, job))


def _plan(context: ServiceContext, job: Job) -> PlanDocument:
    return PlanDocument.model_validate(_content(context, job))


def _content(context: ServiceContext, job: Job) -> object:
    return read_json(context.files.path(find_output(context, job.id, "plan.json").sha256))
