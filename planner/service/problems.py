"""Errors as ``application/problem+json`` (RFC 9457), with the sentences of the command line."""

import json
import logging
import sqlite3
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import Field
from starlette.exceptions import HTTPException

from planner.common.errors import MissingProgramError, NoSolutionError, PlannerError, printable
from planner.service.commands import UnfinishedJobError, UnknownJobError
from planner.service.file_store import DiskFullError
from planner.service.job_requests import ServiceModel

MEDIA_TYPE = "application/problem+json"
LOG = logging.getLogger("edbb.service")
STATUS: tuple[tuple[type[PlannerError], int], ...] = (
    (DiskFullError, 507),
    (UnknownJobError, 404),
    (UnfinishedJobError, 409),
    (NoSolutionError, 422),
    (MissingProgramError, 501),
    (PlannerError, 422),
)


class Problem(ServiceModel):
    """What is wrong, for a program and for a person."""

    title: str = Field(examples=["The input is wrong"])
    status: int = Field(examples=[422])
    detail: str = Field(examples=["cell 'nj130/edbb': neither a file nor a shipped cell"])
    exit_code: int | None = Field(None, description="of the command line", examples=[2])


class ProblemResponse(JSONResponse):
    """A problem as an answer."""

    media_type = MEDIA_TYPE

    def __init__(self, status: int, detail: str, exit_code: int | None = None) -> None:
        problem = Problem(title=HTTPStatus(status).phrase, status=status, detail=printable(detail), exit_code=exit_code)
        super().__init__(problem.model_dump(exclude_none=True), status_code=status)


def request_problem(err: RequestValidationError) -> ProblemResponse:
    """Return what is wrong with a request."""
    return ProblemResponse(422, "; ".join(_fault_sentence(e["loc"], e["msg"], e["input"]) for e in err.errors()[:3]))


def http_problem(err: HTTPException) -> ProblemResponse:
    """Return what a route has refused."""
    answer = ProblemResponse(err.status_code, str(err.detail))
    answer.headers.update(err.headers or {})
    return answer


def add_problem_handlers(app: FastAPI) -> None:
    """Let every other error leave ``app`` as a problem."""

    @app.exception_handler(PlannerError)
    def of_planner(_: Request, err: PlannerError) -> ProblemResponse:
        status = next(s for kind, s in STATUS if isinstance(err, kind))
        return ProblemResponse(status, str(err), err.exit_code)

    @app.exception_handler(sqlite3.OperationalError)
    def of_database(_: Request, err: sqlite3.OperationalError) -> ProblemResponse:
        full = "full" in str(err)
        return ProblemResponse(507 if full else 503, "the disk of the service is full" if full else "the store is busy")

    @app.exception_handler(Exception)
    def of_mistake(request: Request, err: Exception) -> ProblemResponse:
        LOG.error("%s %s", request.method, request.url.path, exc_info=err)
        return ProblemResponse(500, "a mistake of the program; its log tells more")


def _fault_sentence(loc: tuple[str | int, ...], message: str, found: object) -> str:
    """Return which key is wrong, what was found and what is allowed."""
    place = ".".join(str(p) for p in loc if p not in ("body", "query", "path")) or "the request"
    text = message.removeprefix("Value error, ").replace("Input should be", "must be")
    try:
        shown = json.dumps(found, ensure_ascii=False)
    except (TypeError, ValueError):
        shown = ""
    return f"{place}: {text}" + (f", found {shown}" if shown and len(shown) < 120 else "")
