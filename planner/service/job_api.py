"""Routes of jobs: one to submit each kind, and those that all jobs share."""

from collections.abc import Callable
from typing import Annotated, Literal

from fastapi import APIRouter, Body, Query, Response
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException

from planner.service.answers import Job, describe_job
from planner.service.context import Context, ServiceContext
from planner.service.file_api import file_answer
from planner.service.guards import REPORT_POLICY
from planner.service.job_requests import (
    EXAMPLES,
    CellCheckRequest,
    CheckPlanRequest,
    CheckRequest,
    CommandRequest,
    CompensationRequest,
    ErrorMapRequest,
    ExportRequest,
    FixtureViewRequest,
    IdentificationRequest,
    JobId,
    JobRequest,
    PlanRequest,
    PlanViewRequest,
    RunCheckRequest,
    SimulationRequest,
    StudyRequest,
    ValidationRequest,
)
from planner.service.job_store import JobOutput, JobRecord
from planner.service.problems import Problem

JOBS = APIRouter(prefix="/api", tags=["jobs"])
ROUTES: dict[str, type[JobRequest]] = {
    "commands": CommandRequest,
    "plans": PlanRequest,
    "plan-views": PlanViewRequest,
    "cell-checks": CellCheckRequest,
    "fixture-views": FixtureViewRequest,
    "run-checks": RunCheckRequest,
    "simulations": SimulationRequest,
    "exports": ExportRequest,
    "studies": StudyRequest,
    "identifications": IdentificationRequest,
    "error-maps": ErrorMapRequest,
    "check-plans": CheckPlanRequest,
    "checks": CheckRequest,
    "validations": ValidationRequest,
    "compensations": CompensationRequest,
}
Kind = Literal[
    "plan", "plan-view", "cell-check", "run-check", "simulation", "export", "study", "identification", "validation",
    "compensation", "error-map", "command", "check-plan", "check", "fixture-view",
]  # fmt: skip
RESULTS = {
    "plan": "plan.json",
    "identification": "identification.json",
    "validation": "accuracy.json",
    "check-plan": "plan.json",
    "check": "check.json",
    "cell-check": "view.json",
    "fixture-view": "view.json",
    "plan-view": "view.json",
    "run-check": "view.json",
    "error-map": "view.json",
}


def _submit_route(request_type: type[JobRequest]) -> Callable[..., Job]:
    def submit(request: JobRequest, context: Context, response: Response) -> Job:
        job = context.submit(request)
        response.headers["location"] = f"/api/jobs/{job.id}"
        return _job(context, job)

    example = Body(openapi_examples={"example": {"value": EXAMPLES[request_type]}})
    submit.__annotations__["request"] = Annotated[request_type, example]
    submit.__doc__ = f"{request_type.__doc__} The same content gives the same job."
    return submit


for _path, _type in ROUTES.items():
    JOBS.add_api_route(
        f"/{_path}",
        _submit_route(_type),
        methods=["POST"],
        status_code=202,
        response_model=Job,
        name=f"submit {_type.kind}",
        operation_id=f"submit_{_type.kind.replace('-', '_')}",
        responses={404: {"model": Problem}, 409: {"model": Problem}},
    )


@JOBS.get("/jobs")
def list_jobs(
    context: Context, kind: Kind | None = None, most: Annotated[int, Query(ge=1, le=1000)] = 100
) -> list[Job]:
    """List jobs, the latest first."""
    return [_job(context, j) for j in context.jobs.list_jobs(kind, most)]


@JOBS.get("/jobs/{id}", responses={404: {"model": Problem}})
async def get_job(id: JobId, context: Context) -> Job:
    """Get a job: how far it is, and what it has written."""
    # no thread: a read of the database waits for nobody, and many pages ask at once
    return _job(context, find_job(context, id))


@JOBS.post("/jobs/{id}/cancel", responses={404: {"model": Problem}})
def cancel_job(id: JobId, context: Context) -> Job:
    """Stop a job; what has ended stays as it is."""
    find_job(context, id)
    return _job(context, context.jobs.cancel(id))


@JOBS.get("/jobs/{id}/result", responses={404: {"model": Problem}, 409: {"model": Problem}})
def get_result(id: JobId, context: Context) -> FileResponse:
    """Get the document of a finished job: plan.json, identification.json, accuracy.json, view.json or summary."""
    job = find_job(context, id)
    _check_ended(job)
    wanted = (RESULTS.get(job.kind, ""), "printed")
    found = next((o for name in wanted for o in context.jobs.outputs(id) if o.name == name), None)
    if found is None:
        raise HTTPException(404, f"the {job.kind} {id} has no document; its files are listed in the job")
    answer = file_answer(context, found.sha256, f"{job.kind}.json", "application/json")
    answer.headers["content-disposition"] = "inline"
    return answer


@JOBS.get("/jobs/{id}/report", responses={404: {"model": Problem}, 409: {"model": Problem}})
def get_report(id: JobId, context: Context) -> FileResponse:
    """Get the report of a finished job as a page."""
    job = find_job(context, id)
    _check_ended(job)
    found = find_output(context, id, "report.html")
    answer = FileResponse(context.files.path(found.sha256), media_type="text/html; charset=utf-8")
    answer.headers["content-security-policy"] = REPORT_POLICY
    return answer


@JOBS.get("/jobs/{id}/files/{name:path}", responses={404: {"model": Problem}})
def get_file(id: JobId, name: str, context: Context) -> FileResponse:
    """Get one of the files that a job has written."""
    found = find_output(context, id, name)
    return file_answer(context, found.sha256, name.rpartition("/")[2], "image/png" if name.endswith(".png") else None)


def find_job(context: ServiceContext, id: str) -> JobRecord:
    """Return a job.

    Raises:
        HTTPException: there is none.
    """
    try:
        return context.jobs.get(id)
    except KeyError:
        raise HTTPException(404, f"there is no job {id}") from None


def find_output(context: ServiceContext, id: str, name: str) -> JobOutput:
    """Return a file of a job.

    Raises:
        HTTPException: there is none.
    """
    found = next((o for o in context.jobs.outputs(id) if o.name == name), None)
    if found is None:
        raise HTTPException(404, f"the job {id} has no file of that name")
    return found


def _check_ended(job: JobRecord) -> None:
    if not job.ended:
        raise HTTPException(409, f"the {job.kind} {job.id} has no result yet: it is {job.state}")


def _job(context: ServiceContext, job: JobRecord) -> Job:
    return describe_job(job, context.jobs.outputs(job.id) if job.ended else [])
