"""What the interface answers: jobs, files, robots, cells, dialects."""

import json
from datetime import UTC, datetime
from typing import Any, Literal

from pydantic import Field

from planner.common.schema import StrictModel
from planner.service.job_queue import Outlook
from planner.service.job_record import JobOutput, JobProblem, JobRecord, State

Sense = Literal["good", "bad", "open"]


class StoredFile(StrictModel):
    """An uploaded file."""

    id: str = Field(description="SHA-256 of its content")
    name: str = Field(examples=["run.csv"])
    size: int = Field(description="in bytes")


class OutputFile(StrictModel):
    """A file that a job has written."""

    name: str = Field(examples=["plan.json"])
    sha256: str
    size: int
    url: str


class Job(StrictModel):
    """A job: what is asked for, how far it is, and what it has written."""

    id: str
    kind: str = Field(examples=["plan"])
    title: str
    robot: str = Field("", description="model of the robot, where it is known", examples=["comau-nj130"])
    state: State
    stage: str = Field(description="what it is doing")
    done: int = Field(description="how much of the stage is done")
    of: int = Field(description="of how much; 0 where that is not known")
    created: datetime
    started: datetime | None = None
    finished: datetime | None = None
    exit_code: int | None = Field(None, description="of the command; 5: done in part")
    problem: JobProblem | None = None
    files: list[OutputFile] = []
    request: dict[str, Any] = Field(description="as it was submitted")
    url: str
    note: str = Field("", description="what a person has written to it")
    archived: bool = Field(False, description="kept, and not in the list")
    person: str = Field("", description="who asked for it first; empty where nobody had to say")
    people: list[str] = Field(default=[], description="all who have asked for it: it belongs to each")
    serial: str = Field(default="", description="number of the robot that it is of, where that is known")
    verdict: str = Field(default="", description="what it has found, in words", examples=["changed"])
    sense: Sense | None = Field(default=None, description="whether that is good; none where it judges nothing")
    fault: str = Field(default="", description="why its calibration holds no more; not in lists")
    position: int | None = Field(None, description="place among those that wait, from 1; not in lists")
    left_s: float | None = Field(None, description="until it is done [s], by like jobs; not in lists")


class RobotEntry(StrictModel):
    """A robot that comes with the planner, and its ready cells."""

    name: str
    title: str
    joints: int
    payload_kg: float | None
    cells: list[str]


class DialectEntry(StrictModel):
    """A robot language that programs can be written in."""

    name: str
    title: str
    units: str
    max_joints: int


class CellEntry(StrictModel):
    """A cell: shipped (``robot/cell``) or uploaded."""

    id: str
    name: str = Field(description="of its file, or what a person calls it")
    note: str = ""


class Health(StrictModel):
    """That the service is there."""

    version: str
    jobs_running: int
    jobs_waiting: int


def describe_job(job: JobRecord, outputs: list[JobOutput], outlook: Outlook | None = None) -> Job:
    """Return a job as the interface shows it."""
    url = f"/api/jobs/{job.id}"
    return Job(
        id=job.id,
        kind=job.kind,
        title=job.title,
        robot=job.robot,
        state=job.state,
        stage=job.stage if job.state == "running" else "",
        done=job.done,
        of=job.total,
        created=_time(job.created),
        started=_time(job.started) if job.started else None,
        finished=_time(job.finished) if job.finished else None,
        exit_code=job.exit_code,
        problem=job.problem,
        files=[OutputFile(name=o.name, sha256=o.sha256, size=o.size, url=f"{url}/files/{o.name}") for o in outputs],
        request=json.loads(job.request),
        url=url,
        note=job.note,
        archived=job.archived,
        person=job.person,
        position=outlook.position or None if outlook else None,
        left_s=outlook.left_s if outlook else None,
    )


def _time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
