"""What the routes share: the stores, the builder of commands, and the supervisor."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from planner.service.answers import Job, describe_job
from planner.service.commands import CommandBuilder
from planner.service.file_store import FileStore
from planner.service.job_requests import JobRequest
from planner.service.job_store import JobRecord, JobStore
from planner.service.record_store import RecordStore
from planner.service.settings import ServiceSettings
from planner.service.supervisor import Supervisor
from planner.service.uploads import UploadList


@dataclass(frozen=True)
class ServiceContext:
    """The parts of a running service."""

    settings: ServiceSettings
    jobs: JobStore
    files: FileStore
    uploads: UploadList
    records: RecordStore
    commands: CommandBuilder
    supervisor: Supervisor

    def submit(self, request: JobRequest) -> JobRecord:
        """Accept a request, and have it looked at.

        Raises:
            InputError: it names what is not there.
        """
        self.files.check_room()
        job = self.commands.submit(request)
        self.supervisor.wake()
        return job

    def describe(self, job: JobRecord) -> Job:
        """Return a job as the interface shows it."""
        return describe_job(job, self.jobs.outputs(job.id) if job.ended else [])


async def context_of(request: Request) -> ServiceContext:
    """Return the parts of the service that a request came to; no thread is needed for that."""
    return cast(ServiceContext, request.app.state.context)


Context = Annotated[ServiceContext, Depends(context_of)]
