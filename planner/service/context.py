"""The parts of a running service, which the routes share: stores, builder of commands, and what runs the jobs."""

import logging
import shutil
import sqlite3
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import Annotated, ParamSpec, cast

from fastapi import Depends, Request
from fastapi.responses import HTMLResponse

from planner.common.errors import InputError
from planner.service.answers import Job, describe_job
from planner.service.callers import CALLER, CallerFinder, GuessLimit
from planner.service.cluster import Cluster, ClusterRunner
from planner.service.file_store import CellNotes, FileStore, UploadList
from planner.service.job_folder import JobFolder
from planner.service.job_keeping import JobKeeper, QuotaError
from planner.service.job_record import JobCommand, JobProblem, JobRecord
from planner.service.job_request import JobRequest
from planner.service.job_store import MOST_CRASHES, JobStore
from planner.service.people import DeedLog, PeopleStore
from planner.service.record_store import RecordStore
from planner.service.runner import JobRunner
from planner.service.session_store import SessionStore
from planner.service.settings import GB, JobLimits, ServiceSettings
from planner.service.standing import Judge
from planner.service.webhook import Notifier
from planner.workflow.compensate_call import CompensateCall

DESPITE = "--despite-change"  # of CompensateCall
TROUBLE_S = 2.0  # [s] to the next try after a failure
LOG = logging.getLogger("edbb.service")


class ChangedRobotError(InputError):
    """A program is to be corrected by a calibration that holds no more."""


class Supervisor:
    """The thread that takes jobs, and those that run them."""

    def __init__(
        self,
        jobs: JobStore,
        files: FileStore,
        folder: Path,
        workers: int,
        limits: JobLimits,
        beside: int = 1,
        cluster: Cluster | None = None,
    ) -> None:
        self._jobs, self._files, self._folder = jobs, files, folder / "jobs"
        self._workers, self._limits, self._beside, self._cluster = workers, limits, beside, cluster
        self._running: dict[threading.Thread, JobRunner | ClusterRunner] = {}
        self._news, self._stopping = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)

    def start(self) -> None:
        """Remove what earlier servers left, and begin to take jobs."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._files.clear_drafts()
        there = list(self._folder.iterdir())
        alive = self._jobs.running_jobs()  # after the look: another server may begin one meanwhile
        for left in there:
            if left.name not in alive:
                shutil.rmtree(left, ignore_errors=True)
        self._thread.start()

    def wake(self) -> None:
        """Look for jobs now: one was submitted, or something changed."""
        self._news.set()

    def stop(self) -> None:
        """Stop all processes; their jobs wait for the next server."""
        self._stopping = True
        self.wake()
        self._thread.join()
        for runner in self._running.values():
            runner.stop.set()
        for thread in self._running:
            thread.join()
        if self._cluster is not None:
            self._cluster.close()

    def _run(self) -> None:
        while not self._stopping:
            self._news.clear()
            self._running = {t: r for t, r in self._running.items() if t.is_alive()}
            try:
                ready = self._cluster is None or self._cluster.is_ready()
                job = self._jobs.take(self._workers if ready else 0, self._beside)
            except Exception as err:  # the disk may be full: nothing is lost by waiting
                LOG.error("no job could be taken: %s", err, exc_info=not isinstance(err, sqlite3.Error))
                self._news.wait(TROUBLE_S)
                continue
            if job is None:
                self._news.wait(0.5)  # [s] to the next look for a job
            else:
                self._begin(job)

    def _begin(self, job: JobRecord) -> None:
        runner: JobRunner | ClusterRunner
        if self._cluster is not None and not job.command.task:
            runner = self._cluster.runner(job, self._jobs, self._files)
        else:  # a page waits for its tasks: they are short and computed here
            runner = JobRunner(job, self._jobs, self._files, self._folder, self._limits)
        thread = threading.Thread(target=self._watch, args=(runner, job), name=f"job {job.id}", daemon=True)
        self._running[thread] = runner
        thread.start()

    def _watch(self, runner: JobRunner | ClusterRunner, job: JobRecord) -> None:
        try:
            runner.run()
        except Exception:
            LOG.exception("job %s could not be ended", job.id)
            self._try_again(job)
        self.wake()

    def _try_again(self, job: JobRecord) -> None:
        """After a pause let the job wait again, unless it was tried often enough."""
        time.sleep(TROUBLE_S)
        try:
            if job.crashes + 1 < MOST_CRASHES:
                self._jobs.requeue(job, crashed=True)
            else:
                self._jobs.finish(job, "failed", [], None, JobProblem("Internal error", "its result could not be kept"))
        except Exception:
            LOG.exception("job %s waits until its lease ends", job.id)


@dataclass(frozen=True)
class ServiceContext:
    """The parts of a running service."""

    settings: ServiceSettings
    jobs: JobStore
    files: FileStore
    uploads: UploadList
    records: RecordStore
    keeper: JobKeeper
    supervisor: Supervisor
    people: PeopleStore
    guesses: GuessLimit
    finder: CallerFinder
    deeds: DeedLog
    sessions: SessionStore
    judge: Judge
    notifier: Notifier
    cells: CellNotes
    _submitting: threading.Lock = field(default_factory=threading.Lock)

    def submit(self, request: JobRequest) -> JobRecord:
        """Accept a request as a job of whoever asks, and have it looked at; the same content is the same job.

        Raises:
            InputError: it names what is not there.
            QuotaError: the person has as many jobs or files as one may.
            ChangedRobotError: it corrects a program by a calibration that holds no more.
        """
        self.files.check_room()
        folder = JobFolder(self.jobs, self.files, self.uploads, self.cells)
        with self.jobs.at_one_moment():
            command = self._check_standing(request.command(folder))
            title, text, robot = request.subject(folder), request.model_dump_json(), request.robot(folder)
        id, person = request.job_id(command), CALLER.get().name
        with self._submitting:  # nobody slips past the quota by asking often at the same moment
            if not command.task and not self.jobs.is_accepted(id):
                self.check_quota(person)
            job = self.jobs.submit(id, request.job_kind, title, text, command, robot, person, check_inputs=True)
        self.supervisor.wake()
        return job

    def _check_standing(self, command: JobCommand) -> JobCommand:
        """Refuse to correct a program by a calibration that holds no more, unless the command says so; return the rest.

        Raises:
            ChangedRobotError: it holds no more.
        """
        if command.words[0] != CompensateCall.verb:
            return command
        if DESPITE in command.words:
            return replace(command, words=tuple(w for w in command.words if w != DESPITE))
        made = {
            j.id for given in command.inputs for j in self.jobs.jobs_with("outputs", given.sha256, "identification")
        }
        fault = next((f for id in sorted(made) if (f := self.judge.standing(id).fault)), "")
        if fault:
            raise ChangedRobotError(
                f"{fault}. A program corrected by this calibration may be wrong; "
                f"{DESPITE} (despite_change in a request) corrects it anyway"
            )
        return command

    def check_quota(self, person: str, new_jobs: int = 1) -> None:
        """Refuse more of a person who has as much as one may.

        Raises:
            QuotaError: the person has.
        """
        quota = self.settings.quota
        if not person:
            return
        if quota.jobs is not None and (there := self.jobs.count_open(person)) + new_jobs > quota.jobs:
            raise QuotaError(f"{there} jobs of {person} wait or run, as many as one person may have; wait, or stop one")
        if quota.size_bytes is not None and (size := self.keeper.size_bytes(person)) > quota.size_bytes:
            raise QuotaError(
                f"the files of {person} take {size / GB:.3g} GB, more than the {quota.size_bytes / GB:.3g} GB that one "
                "person may have; delete jobs and files that nobody needs (DELETE /api/jobs/ID, /api/files/ID)"
            )

    def describe(self, job: JobRecord) -> Job:
        """Return a job as the interface shows it."""
        with self.jobs.at_one_moment():
            outlook = None if job.ended else self.jobs.outlook(job.id, self.settings.workers)
            found = describe_job(job, self.jobs.outputs(job.id) if job.ended else [], outlook)
            fault = self.judge.standing(self._calibration(found) or "").fault if job.ended else ""
            return self._add_findings([found.model_copy(update={"fault": fault})])[0]

    def _calibration(self, job: Job) -> str | None:
        """Return the identification that a job is, or whose robot it corrects for."""
        return {"identification": job.id, "compensation": job.request.get("model")}.get(job.kind)

    def _add_findings(self, jobs: list[Job]) -> list[Job]:
        """Return jobs with what each has found, of which robot it is and who has asked for it."""
        serials, people = (find([j.id for j in jobs]) for find in (self.jobs.serials_of, self.jobs.people_of))
        out = []
        for job in jobs:
            found = {"serial": serials.get(job.id, ""), "people": people.get(job.id, [])}
            if verdict := self.judge.verdict(job):
                found |= {"verdict": verdict.words, "sense": verdict.sense}
            out.append(job.model_copy(update=found))
        return out

    def show(self, id: str) -> Job:
        """Return the job of an identifier as the interface shows it, all of it of one moment.

        Raises:
            UnknownJobError: there is none.
        """
        with self.jobs.at_one_moment():
            return self.describe(self.jobs.get(id))

    def describe_all(self, jobs: Sequence[JobRecord]) -> list[Job]:
        """Return jobs as the interface shows them."""
        outputs = self.jobs.outputs_of([j.id for j in jobs if j.ended])
        return self._add_findings([describe_job(j, outputs.get(j.id, [])) for j in jobs])


async def context_of(request: Request) -> ServiceContext:
    """Return the parts of the service that a request came to; no thread is needed for that."""
    return cast(ServiceContext, request.app.state.context)


Context = Annotated[ServiceContext, Depends(context_of)]


Page = ParamSpec("Page")


def at_one_moment(page: Callable[Page, HTMLResponse]) -> Callable[Page, HTMLResponse]:
    """Let all that a page says be of one moment: jobs may begin, end and be deleted while it is made."""

    @wraps(page)
    def read(*args: Page.args, **named: Page.kwargs) -> HTMLResponse:
        """Read the records that have changed, then the page."""
        context = cast(ServiceContext, named["context"])
        context.records.index.refresh()
        with context.jobs.at_one_moment():
            return page(*args, **named)

    return read
