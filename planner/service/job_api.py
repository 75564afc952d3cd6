"""Routes of jobs: one to submit each kind, those that all jobs share, and the stream of their events."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Body, Header, Query, Request, Response
from fastapi.responses import FileResponse, StreamingResponse
from pydantic import AwareDatetime, Field
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from planner.common.schema import StrictModel
from planner.service.access import submit_path
from planner.service.answers import Job
from planner.service.callers import CALLER, Caller
from planner.service.context import Context, ServiceContext
from planner.service.file_api import StoredFileResponse, file_answer
from planner.service.guards import REPORT_POLICY
from planner.service.job_folder import JobId
from planner.service.job_keeping import JobChanges
from planner.service.job_record import PLACE, JobEvent, JobFilter, JobOutput, JobPlace, JobRecord, State
from planner.service.job_request import JobRequest
from planner.service.job_requests import REQUESTS
from planner.service.job_store import JobCheck, JobStore

JOBS = APIRouter(prefix="/api", tags=["jobs"])


def own_check(context: ServiceContext) -> JobCheck:
    """Return what refuses to change a job that only others have asked for, unless an administrator asks.

    It raises ForbiddenError.
    """

    def check(job: JobRecord) -> None:
        """Refuse a job of others."""
        asked = context.jobs.askers(job.id)
        if CALLER.get().name not in asked:
            CALLER.get().check_owner(min(asked - {""}, default=""))

    return check


Kind = Literal[
    "plan", "plan-view", "cell-check", "run-check", "simulation", "export", "study", "identification", "validation",
    "compensation", "command", "check-plan", "check", "fixture-view", "plan-upload",
]  # fmt: skip
LIST_MOST = 1000  # entries of a page of a list


class JobPage(StrictModel):
    """Which jobs a page of the list holds."""

    kind: Kind | None = None
    state: State | None = None
    robot: Annotated[str, Field(max_length=100)] | None = Field(None, description="model of the robot")
    person: Annotated[str, Field(max_length=64)] | None = Field(
        None, description="who asked for it, alone or with others"
    )
    q: str = Field("", max_length=200, description="text that title, note or serial number has")
    since: AwareDatetime | None = Field(None, description="submitted then or later")
    until: AwareDatetime | None = Field(None, description="submitted before")
    tasks: bool = Field(False, description="also what only serves a page: views and checks of cells")
    archived: bool = Field(False, description="those that were put aside, instead of the others")
    most: int = Field(100, ge=1, le=LIST_MOST)
    after: str = Field("", pattern=f"^({PLACE})?$", description="where the page before ended, of its Link header")

    @property
    def job_filter(self) -> JobFilter:
        """The jobs that are asked for."""
        since, until = (None if t is None else t.timestamp() for t in (self.since, self.until))
        shown = (self.tasks, self.archived, self.person)
        return JobFilter(self.kind, self.state, self.robot, self.q, since, until, *shown)


def next_link(request: Request, place: str) -> str:
    """Return the ``Link`` header to the next page of a list: the same request, starting after the last entry."""
    url = request.url.include_query_params(after=place)
    return f'<{url.path}?{url.query}>; rel="next"'


def _submit_route(request_type: type[JobRequest]) -> Callable[..., Job]:
    def submit(request: JobRequest, context: Context, response: Response) -> Job:
        """Put the job of a request into the queue."""
        job = context.submit(request)
        response.headers["location"] = f"/api/jobs/{job.id}"
        return context.describe(job)

    example = Body(openapi_examples={"example": {"value": request_type.example}})
    submit.__annotations__["request"] = Annotated[request_type, example]
    submit.__doc__ = f"{request_type.__doc__} The same content gives the same job."
    return submit


for _kind, _type in REQUESTS.items():
    JOBS.add_api_route(
        submit_path(_kind),
        _submit_route(_type),
        methods=["POST"],
        status_code=202,
        response_model=Job,
        name=f"submit {_kind}",
        operation_id=f"submit_{_kind.replace('-', '_')}",
    )


@JOBS.get("/jobs")
def list_jobs(context: Context, request: Request, response: Response, page: Annotated[JobPage, Query()]) -> list[Job]:
    """List jobs, the latest first; where there are more, the header ``Link`` leads to the next page (RFC 8288)."""
    after = JobPlace.parse(page.after) if page.after else None
    with context.jobs.at_one_moment():
        found = context.jobs.list_jobs(page.job_filter, page.most + 1, after)
        if len(found) > page.most:
            last = found[page.most - 1]
            response.headers["link"] = next_link(request, str(JobPlace(last.created, last.id)))
        return context.describe_all(found[: page.most])


@JOBS.get("/jobs/{id}")
async def get_job(id: JobId, context: Context) -> Job:
    """Get a job: how far it is, and what it has written."""
    # no thread: a read of the database waits for nobody, and many pages ask at once
    return context.show(id)


@JOBS.patch("/jobs/{id}")
def change_job(id: JobId, changes: JobChanges, context: Context) -> Job:
    """Give a job another title or a note, or put it aside; what is not given stays."""
    return context.describe(context.keeper.change(id, changes, own_check(context)))


@JOBS.delete("/jobs/{id}", status_code=204)
def delete_job(id: JobId, context: Context) -> None:
    """Delete a job with what only it needs: its files, and the views of pages that start from it.

    What others have asked for too stays theirs: it is only no longer the caller's.
    """
    if not context.jobs.leave(id, CALLER.get().name):
        context.keeper.delete(id, own_check(context))


@JOBS.post("/jobs/{id}/cancel")
def cancel_job(id: JobId, context: Context) -> Job:
    """Stop a job; what has ended stays as it is, and what others have asked for too goes on for them."""
    if not context.jobs.get(id).ended and context.jobs.leave(id, CALLER.get().name):
        return context.show(id)
    return context.describe(context.jobs.cancel(id, own_check(context)))


@JOBS.get("/jobs/{id}/result")
def get_result(id: JobId, context: Context) -> FileResponse:
    """Get the document of a finished job: plan.json, identification.json, accuracy.json, view.json or summary."""
    with context.jobs.at_one_moment():
        job, outputs = context.jobs.get(id), context.jobs.outputs(id)
    _refuse_unfinished_job(job)
    wanted = (REQUESTS[job.kind].document, "printed")
    found = next((o for name in wanted for o in outputs if o.name == name), None)
    if found is None:
        raise HTTPException(404, f"the {job.kind} {id} has no document; its files are listed in the job")
    answer = file_answer(context, found.sha256, f"{job.kind}.json", "application/json")
    answer.headers["content-disposition"] = "inline"
    return answer


@JOBS.get("/jobs/{id}/report")
def get_report(id: JobId, context: Context) -> FileResponse:
    """Get the report of a finished job as a page."""
    job = context.jobs.get(id)
    _refuse_unfinished_job(job)
    found = find_output(context, id, "report.html")
    answer = StoredFileResponse(context.files.path(found.sha256), media_type="text/html; charset=utf-8")
    answer.headers["content-security-policy"] = REPORT_POLICY
    return answer


@JOBS.get("/jobs/{id}/files/{name:path}")
def get_file(id: JobId, name: str, context: Context) -> FileResponse:
    """Get one of the files that a job has written."""
    found = find_output(context, id, name)
    return file_answer(context, found.sha256, name.rpartition("/")[2], "image/png" if name.endswith(".png") else None)


def find_output(context: ServiceContext, id: str, name: str) -> JobOutput:
    """Return a file of a job.

    Raises:
        HTTPException: there is none.
    """
    found = next((o for o in context.jobs.outputs(id) if o.name == name), None)
    if found is None:
        raise HTTPException(404, f"the job {id} has no file of that name")
    return found


def output_path(context: ServiceContext, id: str, name: str) -> Path:
    """Return where a file of a job lies in the store.

    Raises:
        HTTPException: there is none, or it is gone.
    """
    path = context.files.path(find_output(context, id, name).sha256)
    if not path.is_file():
        raise HTTPException(404, f"the file {name} of the job {id} was deleted")
    return path


def _refuse_unfinished_job(job: JobRecord) -> None:
    if not job.ended:
        raise HTTPException(409, f"the {job.kind} {job.id} has no result yet: it is {job.state}")


EVENTS = APIRouter(prefix="/api", tags=["events"])
MOST_EVENT = 2**62  # the largest number of an event that the database holds


STREAMS: Counter[str] = Counter()
"""How many streams each person follows."""


@EVENTS.get("/events", response_class=StreamingResponse, responses={200: {"content": {"text/event-stream": {}}}})
async def stream_events(
    context: Context,
    request: Request,
    job: Annotated[list[JobId], Query(description="jobs; all where none is named", max_length=50)] = [],  # noqa: B006
    last_event_id: Annotated[str | None, Header(description="number of the last event that came")] = None,
    after: Annotated[int | None, Query(ge=0, le=MOST_EVENT, description="the same, for a first request")] = None,
    wait: Annotated[bool, Query(description="go on with what will happen; else end with what has")] = True,
) -> StreamingResponse:
    """Follow jobs: ``queued``, ``running``, ``progress`` and ``end``, each with its number."""
    most, most_of_one = 200, 50  # streams at a time; of a person who is known by name
    who = CALLER.get().name
    if STREAMS.total() >= most or (who and STREAMS[who] >= most_of_one):
        raise HTTPException(503, "too many pages are open", {"retry-after": "10"})
    start = await run_in_threadpool(_start, context.jobs, job, last_event_id, after)
    news = _stream(context, request, job, start, wait)
    return StreamingResponse(news, media_type="text/event-stream", headers={"cache-control": "no-store"})


def _start(jobs: JobStore, named: list[str], last_event_id: str | None, after: int | None) -> int:
    """Number after which the stream begins: of named jobs all, of all jobs what is new."""
    if last_event_id is not None and last_event_id.isascii() and last_event_id.isdigit():
        return min(int(last_event_id[:19]), MOST_EVENT)
    if after is not None:
        return after
    return 0 if named else jobs.last_event()


async def _stream(
    context: ServiceContext, request: Request, named: list[str], last: int, wait: bool, known_s: float = 5.0
) -> AsyncIterator[str]:
    """Yield events until the client goes, or may not look any more: its session has ended, or its token.

    ``known_s``: after which it is looked again who follows them [s].
    """
    who = CALLER.get().name
    STREAMS[who] += 1
    try:
        yield "retry: 2000\n\n"
        told = known = time.monotonic()
        while True:
            if time.monotonic() - known > known_s:
                known, found = time.monotonic(), await run_in_threadpool(context.finder.find, request.scope)
                if not isinstance(found, Caller):
                    return
            events = await run_in_threadpool(context.jobs.events_after, last, named)
            for event in events:
                last, told = event.id, time.monotonic()
                yield event_text(event)
            if not events and not wait:
                return
            if time.monotonic() - told > 15.0:  # [s] after which a comment keeps the stream open
                told = time.monotonic()
                yield ": alive\n\n"
            if not events:
                await asyncio.sleep(0.25)  # [s] between two looks for news
    finally:
        STREAMS[who] -= 1


def event_text(event: JobEvent) -> str:
    """Return an event as the stream writes it."""
    content = f'{{"job":"{event.job}",{event.content[1:]}' if event.content != "{}" else f'{{"job":"{event.job}"}}'
    return f"id: {event.id}\nevent: {event.kind}\ndata: {content}\n\n"
