"""Routes of sessions at the cell: what one device ticks others see, also what was ticked without a network.

What to do at the cell, from an empty one to a saved log, as a checklist says it.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query
from fastapi import Path as InPath
from fastapi.responses import FileResponse, HTMLResponse
from pydantic import Field
from starlette.exceptions import HTTPException

from planner.cell.file import CellFile
from planner.cell.reading import gauge_class, read_cell_file
from planner.common.schema import StrictModel
from planner.service.answers import OutputFile
from planner.service.callers import CALLER
from planner.service.context import Context, ServiceContext
from planner.service.job_api import output_path
from planner.service.job_folder import JobId
from planner.service.page_content import PLANS, AnyPlan, read_plan_document
from planner.service.record_api import SerialText
from planner.service.record_index import RobotFilter
from planner.service.rendering import STATIC, render
from planner.service.session_store import CellSession, KnownTick, TickList


def session_content(plan: AnyPlan, cell: CellFile, files: list[OutputFile]) -> dict[str, object]:
    """Return what the checklist from an empty cell to a saved log says of a plan; files of a program share its name."""
    stems, gauge = tuple(Path(p.file).stem for p in plan.programs), gauge_class(cell)
    return {
        "plan": plan,
        "guide": gauge.session_guide(cell),
        "reading": gauge.reading_text(cell),
        "by_hand": cell.gauge.read_by == "hand" and gauge.columns == "length_mm",
        "programs": [f for f in files if f.name.startswith(stems)],
        "static": cell.motion.measure == "static",
    }


SESSIONS = APIRouter(tags=["sessions"])
SessionId = Annotated[str, InPath(pattern="^[0-9a-f]{24}$", description="identifier of a session")]


class SessionRequest(StrictModel):
    """Which robot is measured by which plan."""

    plan: JobId
    serial: SerialText
    anew: bool = Field(False, description="end the open session of this robot and plan, which stays, and begin another")


class SessionEntry(StrictModel):
    """A session at the cell: robot, plan, day, people and what they have ticked."""

    id: str
    plan: str
    serial: str = Field(description="of the robot; empty of a session of an earlier version")
    begun: datetime
    ended: datetime | None = Field(description="when it was begun again; none of one that is open")
    people: list[str]
    ticks: list[KnownTick]
    url: str


@SESSIONS.post("/api/sessions", status_code=201)
def begin_session(request: SessionRequest, context: Context) -> SessionEntry:
    """Begin a session of a robot, or go on with the open one; several devices may tick in one."""
    job = context.show(request.plan)
    if job.kind not in PLANS or job.state != "done":
        raise HTTPException(422, f"the {job.kind} {job.id} is no finished plan: sessions are of plans")
    # it has to be known, and of the plan's model: a mistyped serial number makes no robot
    context.records.require(request.serial, read_plan_document(context, job).robot)
    return describe_session(context, context.sessions.begin(job.id, request.serial, CALLER.get().name, request.anew))


@SESSIONS.get("/api/sessions")
def list_sessions(
    context: Context,
    serial: Annotated[str | None, Query(max_length=61, description="of the robot")] = None,
    plan: Annotated[JobId | None, Query()] = None,
) -> list[SessionEntry]:
    """List the latest 200 sessions, of a robot or a plan where one is named."""
    return [describe_session(context, s) for s in context.sessions.list_sessions(serial, plan)]


@SESSIONS.get("/api/sessions/{id}")
def get_session(id: SessionId, context: Context) -> SessionEntry:
    """Get a session with its ticks."""
    return describe_session(context, context.sessions.get(id))


@SESSIONS.post("/api/sessions/{id}/ticks")
def add_ticks(id: SessionId, ticks: TickList, context: Context) -> SessionEntry:
    """Say what was ticked; of each step the latest counts. The answer is what is known then."""
    context.sessions.merge(id, ticks.ticks, CALLER.get().name or ticks.person.strip())
    return describe_session(context, context.sessions.get(id))


@SESSIONS.get("/jobs/{id}/session", include_in_schema=False, response_class=HTMLResponse)
def choose_session(id: JobId, context: Context, serial: str = "") -> HTMLResponse:
    """Ask for the robot that the plan is measured on, or go on with an open session."""
    context.records.index.refresh()
    job = context.show(id)
    if job.kind not in PLANS or job.state != "done":
        return render("problem", 404, detail="Only a finished plan has a session.")
    robot = read_plan_document(context, job).robot
    sessions = [describe_session(context, s) for s in context.sessions.list_sessions(plan=id)]
    known = context.records.index.list_robots(RobotFilter(robot=robot), 200)  # serial numbers offered
    serials = [r.serial for r in known]
    return render("sessions", job=job, robot=robot, sessions=sessions, serials=serials, serial=serial)


@SESSIONS.get("/sessions/{id}", include_in_schema=False, response_class=HTMLResponse)
def show_session(id: SessionId, context: Context) -> HTMLResponse:
    """Show what to do at the cell, as a checklist of one session."""
    session = describe_session(context, context.sessions.get(id))
    job = context.show(session.plan)
    plan = read_plan_document(context, job)
    cell = read_cell_file(output_path(context, job.id, "cell.toml"))
    return render("session", job=job, session=session, **session_content(plan, cell, job.files))


@SESSIONS.get("/worker.js", include_in_schema=False)
def get_page_worker() -> FileResponse:
    """The script that keeps the checklist for when there is no network; it lies above the pages that it serves."""
    return FileResponse(STATIC / "worker.js", media_type="text/javascript", headers={"cache-control": "no-cache"})


def describe_session(context: ServiceContext, session: CellSession) -> SessionEntry:
    """Return a session as the interface shows it."""
    return SessionEntry(
        id=session.id,
        plan=session.plan,
        serial=session.serial,
        begun=session.begun_at,
        ended=None if session.ended is None else datetime.fromtimestamp(session.ended, UTC),
        people=context.sessions.people(session),
        ticks=context.sessions.list_ticks(session.id),
        url=f"/sessions/{session.id}",
    )
