"""Errors as ``application/problem+json`` (RFC 9457), with the sentences of the command line."""

import json
import sqlite3
from http import HTTPStatus

from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from planner.common.errors import MissingProgramError, NoSolutionError, PlannerError, make_printable
from planner.common.schema import StrictModel
from planner.service.certificate import UncertifiedError
from planner.service.command_words import RefusedCommandError, hide_folders
from planner.service.context import ChangedRobotError
from planner.service.database import damage_text, is_damage
from planner.service.file_store import DiskFullError, DisturbedTransferError, UnknownFileError
from planner.service.job_folder import UnfinishedJobError
from planner.service.job_keeping import KeptJobError, QuotaError
from planner.service.job_store import UnknownJobError
from planner.service.record_store import RecordConflictError, UnknownRecordError
from planner.service.session_store import EndedSessionError, UnknownSessionError

MEDIA_TYPE = "application/problem+json"
# codes of HTTP (RFC 9110)
STATUS: tuple[tuple[type[PlannerError], int], ...] = (
    (DiskFullError, 507),
    (DisturbedTransferError, 409),
    (UnknownFileError, 404),
    (RefusedCommandError, 403),
    (UnknownJobError, 404),
    (UnknownRecordError, 404),
    (UnknownSessionError, 404),
    (UnfinishedJobError, 409),
    (RecordConflictError, 409),
    (EndedSessionError, 409),
    (ChangedRobotError, 409),
    (UncertifiedError, 409),
    (KeptJobError, 409),
    (QuotaError, 429),
    (NoSolutionError, 422),
    (MissingProgramError, 501),
    (PlannerError, 422),
)


class Problem(StrictModel):
    """What is wrong, for a program and for a person."""

    type: str = Field(default="about:blank", description="of RFC 9457: the title is that of the status")
    title: str = Field(examples=["Unprocessable Content"])
    status: int = Field(examples=[422])
    detail: str = Field(examples=["cell 'nj130/edbb': neither a file nor a shipped cell"])
    exit_code: int | None = Field(None, description="of the command line", examples=[2])


ERRORS = (RequestValidationError, HTTPException, ClientDisconnect, PlannerError, sqlite3.DatabaseError, Exception)


class ProblemResponse(JSONResponse):
    """A problem as an answer."""

    media_type = MEDIA_TYPE

    def __init__(self, status: int, detail: str, exit_code: int | None = None) -> None:
        self.detail = make_printable(hide_folders(detail))
        problem = Problem(title=HTTPStatus(status).phrase, status=status, detail=self.detail, exit_code=exit_code)
        super().__init__(problem.model_dump(exclude_none=True), status_code=status)


def problem_of(err: Exception) -> ProblemResponse:
    """Return the problem document (RFC 9457) of an error."""
    match err:
        case RequestValidationError():
            sentences = [_fault_sentence(e["loc"], e["msg"], e["input"]) for e in err.errors()[:3]]
            return ProblemResponse(422, "; ".join(sentences))
        case HTTPException():
            answer = ProblemResponse(err.status_code, str(err.detail))
            answer.headers.update(err.headers or {})
            return answer
        case ClientDisconnect():
            return ProblemResponse(400, "the client went before it had sent all")
        case PlannerError():
            return ProblemResponse(next(s for kind, s in STATUS if isinstance(err, kind)), str(err), err.exit_code)
        case sqlite3.OperationalError() if "full" in str(err):
            return ProblemResponse(507, "the disk of the service is full")
        case sqlite3.OperationalError():
            return ProblemResponse(503, "the store is busy")
        case sqlite3.DatabaseError() if is_damage(err):
            return ProblemResponse(500, damage_text(err))
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
