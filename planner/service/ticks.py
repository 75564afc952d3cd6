"""Routes of the checklist of a session: what one device ticks others see, also what was ticked without a network."""

from fastapi import APIRouter
from fastapi.responses import FileResponse

from planner.service.callers import CALLER
from planner.service.context import Context
from planner.service.job_folder import JobId
from planner.service.problems import Problem
from planner.service.rendering import STATIC
from planner.service.tick_store import KnownTick, TickList

TICKS = APIRouter()


@TICKS.get("/api/jobs/{id}/ticks", tags=["jobs"], responses={404: {"model": Problem}})
def get_ticks(id: JobId, context: Context) -> list[KnownTick]:
    """Get the ticked items of a plan's checklist."""
    context.jobs.get(id)
    return context.ticks.list_ticks(id)


@TICKS.post("/api/jobs/{id}/ticks", tags=["jobs"], responses={404: {"model": Problem}})
def add_ticks(id: JobId, ticks: TickList, context: Context) -> list[KnownTick]:
    """Say what was ticked; of each step the latest counts. The answer is what is known then."""
    context.ticks.merge(id, ticks.ticks, CALLER.get().name)
    return context.ticks.list_ticks(id)


@TICKS.get("/worker.js", include_in_schema=False)
def get_page_worker() -> FileResponse:
    """The script that keeps the checklist for when there is no network; it lies above the pages that it serves."""
    return FileResponse(STATIC / "worker.js", media_type="text/javascript", headers={"cache-control": "no-cache"})
