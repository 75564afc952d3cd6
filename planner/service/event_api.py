"""Server-sent events: one stream a page for all its jobs, resumed by the number of the last event that came."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Query
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from planner.service.context import Context
from planner.service.job_requests import JobId
from planner.service.job_store import JobEvent, JobStore

EVENTS = APIRouter(prefix="/api", tags=["events"])
LOOK_S, ALIVE_S, MOST_STREAMS = 0.25, 15.0, 200
MOST_NUMBER = 2**62


class StreamCount:
    """How many streams are open."""

    def __init__(self) -> None:
        self.open = 0


STREAMS = StreamCount()


@EVENTS.get("/events", response_class=StreamingResponse, responses={200: {"content": {"text/event-stream": {}}}})
async def stream_events(
    context: Context,
    job: Annotated[list[JobId], Query(description="jobs; all where none is named", max_length=50)] = [],  # noqa: B006
    last_event_id: Annotated[str | None, Header(description="number of the last event that came")] = None,
    after: Annotated[int | None, Query(ge=0, le=MOST_NUMBER, description="the same, for a first request")] = None,
    wait: Annotated[bool, Query(description="go on with what will happen; else end with what has")] = True,
) -> StreamingResponse:
    """Follow jobs: ``queued``, ``running``, ``progress`` and ``end``, each with its number."""
    if STREAMS.open >= MOST_STREAMS:
        raise HTTPException(503, "too many pages are open", {"retry-after": "10"})
    start = await run_in_threadpool(_start, context.jobs, job, last_event_id, after)
    return StreamingResponse(
        _stream(context.jobs, job, start, wait), media_type="text/event-stream", headers={"cache-control": "no-store"}
    )


def _start(jobs: JobStore, named: list[str], last_event_id: str | None, after: int | None) -> int:
    """Number after which the stream begins: of named jobs all, of all jobs what is new."""
    if last_event_id is not None and last_event_id.isascii() and last_event_id.isdigit():
        return min(int(last_event_id[:19]), MOST_NUMBER)
    if after is not None:
        return after
    return 0 if named else jobs.last_event()


async def _stream(jobs: JobStore, named: list[str], last: int, wait: bool) -> AsyncIterator[str]:
    STREAMS.open += 1
    try:
        yield "retry: 2000\n\n"
        told = time.monotonic()
        while True:
            events = await run_in_threadpool(jobs.events_after, last, named)
            for event in events:
                last, told = event.id, time.monotonic()
                yield event_text(event)
            if not events and not wait:
                return
            if time.monotonic() - told > ALIVE_S:
                told = time.monotonic()
                yield ": alive\n\n"
            if not events:
                await asyncio.sleep(LOOK_S)
    finally:
        STREAMS.open -= 1


def event_text(event: JobEvent) -> str:
    """Return an event as the stream writes it."""
    content = f'{{"job":"{event.job}",{event.content[1:]}' if event.content != "{}" else f'{{"job":"{event.job}"}}'
    return f"id: {event.id}\nevent: {event.kind}\ndata: {content}\n\n"
