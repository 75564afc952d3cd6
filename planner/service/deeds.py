"""The log of deeds for administrators, as page and interface."""

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse
from pydantic import Field

from planner.common.schema import StrictModel
from planner.service.context import Context
from planner.service.job_api import LIST_MOST, next_link
from planner.service.people import Deed
from planner.service.rendering import render

DEEDS = APIRouter()


class DeedEntry(StrictModel):
    """Something that somebody did."""

    id: int
    at: datetime
    person: str = Field(description="empty: nobody had to say it, or the token of the service was given")
    address: str
    deed: str = Field(examples=["stopped a job"])
    subject: str = Field(description="what it was done to", examples=["/api/jobs/0123456789abcdef01234567"])
    status: int = Field(description="of the answer", examples=[200])


def describe_deed(deed: Deed) -> DeedEntry:
    """Return a deed as the interface shows it."""
    return DeedEntry(**{**vars(deed), "at": datetime.fromtimestamp(deed.at, UTC)})


PersonName = Annotated[str | None, Query(max_length=64, description="of one person")]
Before = Annotated[int | None, Query(ge=0, le=2**62, description="deeds before the one of this number")]


@DEEDS.get("/api/deeds", tags=["people"])
def list_deeds(
    context: Context,
    request: Request,
    response: Response,
    person: PersonName = None,
    after: Before = None,
    most: Annotated[int, Query(ge=1, le=LIST_MOST)] = 100,
) -> list[DeedEntry]:
    """List who did what, the latest first, for administrators; the header ``Link`` leads to the next page."""
    found = context.deeds.list_deeds(person, after, most + 1)
    if len(found) > most:
        response.headers["link"] = next_link(request, str(found[most - 1].id))
    return [describe_deed(d) for d in found[:most]]


@DEEDS.get("/deeds", include_in_schema=False, response_class=HTMLResponse)
def show_deeds(context: Context, person: PersonName = None, after: Before = None) -> HTMLResponse:
    """Show the page with the log of deeds."""
    most = 100  # of a page
    found = context.deeds.list_deeds(person or None, after, most + 1)
    shown = [describe_deed(d) for d in found[:most]]
    people = sorted({p.name for p in context.people.list_people()} | {d.person for d in shown} - {""})
    more = shown[-1].id if len(found) > most else None
    return render("deeds", deeds=shown, people=people, person=person or "", more=more)
