"""Jobs on the workers of a Dask cluster: the engine knows who lives, and gives the work of a dead worker to another.

The service keeps what it promises: a job is its own under a fence, whoever computes it, so that what a worker that was
taken for dead sends later is not looked at.
"""

import logging
import secrets
import threading
import time
from typing import Any

from planner.common.cluster import connect
from planner.common.errors import PlannerError
from planner.service.cluster_work import Work, WorkEnd, run_work
from planner.service.file_store import FileStore
from planner.service.job_record import JobOutput, JobProblem, JobRecord
from planner.service.job_store import LEASE_S, MOST_CRASHES, JobStore
from planner.service.settings import ClusterSettings, JobLimits

LOG = logging.getLogger("edbb.service")
LOST = ("cancelled", "lost")  # states of a task that the cluster forgot: the scheduler went, or was begun anew


class Cluster:
    """The workers of a cluster.

    Raises:
        InputError: the cluster can be reached without its keys from other machines.
        MissingProgramError: Dask is not installed, or nobody answers at the address.
    """

    def __init__(self, settings: ClusterSettings, limits: JobLimits) -> None:
        self._settings, self._limits = settings, limits
        self.token = secrets.token_urlsafe(32)  # bytes; workers read files by it, as long as this server lives
        self._client: Any = None
        self._connect()

    def _connect(self) -> None:
        at = self._settings
        self._client = connect(at.scheduler, at.keys, "--cluster", at.answer_s, "edbb-serve", only_data=True)

    def is_ready(self) -> bool:
        """Tell whether work can be given out; a connection that has ended is made anew."""
        if self._client.status == "closed":
            try:
                self._connect()
            except PlannerError as err:
                LOG.error("%s", err)
        return bool(self._client.status == "running")

    def close(self) -> None:
        """Let go of the cluster."""
        self._client.close()

    def runner(self, job: JobRecord, jobs: JobStore, files: FileStore) -> "ClusterRunner":
        """Return the runner of a job on the cluster."""
        work = Work(job, self._limits, self._settings.url.rstrip("/"), self.token)
        return ClusterRunner(self._client, work, jobs, files)


class ClusterRunner:
    """Runs a job that this server has taken on a worker of the cluster."""

    def __init__(self, client: Any, work: Work, jobs: JobStore, files: FileStore) -> None:
        self._client, self._work, self._job, self._jobs, self._files = client, work, work.job, jobs, files
        self.stop = threading.Event()

    def run(self) -> None:
        """Give the job out and end it by what came of it."""
        name = self._work.name
        self._client.subscribe_topic(name, self._pass_on)
        future = self._client.submit(run_work, self._work, key=name, pure=False)
        try:
            if self._wait(future):
                self._end(future)
        finally:
            self._client.unsubscribe_topic(name)
            future.cancel()

    def _wait(self, future: Any) -> bool:
        """Hold the lease until the work has ended; return whether it has, and is not stopped here."""
        renewed = time.monotonic()
        while not future.done():
            if self.stop.wait(0.1):  # [s] between two looks
                self._jobs.requeue(self._job, crashed=False)
                return False
            if self._jobs.wants_stop(self._job):
                self._jobs.finish(self._job, "cancelled", [], None, None)
                return False
            if time.monotonic() - renewed > LEASE_S / 4:
                renewed = time.monotonic()
                self._jobs.renew(self._job)
        return True

    def _end(self, future: Any) -> None:
        if future.status in LOST:
            self._jobs.requeue(self._job, crashed=False)
            return
        try:
            end = WorkEnd.of(future.result())
        except Exception as err:  # no data came, its workers died, or the cluster forgot it
            LOG.error("job %s: %s", self._job.id, err)
            end = WorkEnd(None, crashed=future.status not in LOST)
        if end.state is not None:
            with self._files.hold_files():
                written = [JobOutput(name, self._files.add(data), len(data)) for name, data in end.files.items()]
                self._jobs.finish(self._job, end.state, written, end.exit_code, end.problem)
        elif end.crashed and self._job.crashes + 1 >= MOST_CRASHES:
            detail = f"its process or its worker was killed {MOST_CRASHES} times; the machine may be out of memory"
            self._jobs.finish(self._job, "failed", [], None, JobProblem("The process was killed", detail))
        else:
            self._jobs.requeue(self._job, end.crashed)

    def _pass_on(self, event: tuple[float, Any]) -> None:
        most = 80  # signs of the name of a stage
        try:
            stage, done, total = event[1]
            self._jobs.progress(self._job, str(stage)[:most], int(done), int(total))
        except (TypeError, ValueError) as err:
            LOG.error("job %s: what a worker says of its progress is not understood: %s", self._job.id, err)
