"""One job on a worker of a Dask cluster: files are fetched by hash, it runs as beside the service and is handed back.

The worker needs nothing of the service but its address.
"""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.request import Request, urlopen

from pydantic import TypeAdapter

from planner import __version__
from planner.common.errors import InputError
from planner.common.file_names import name_fault
from planner.service.file_store import FileStore
from planner.service.job_record import JobOutput, JobProblem, JobRecord, State
from planner.service.runner import JobRunner
from planner.service.settings import JobLimits


@dataclass(frozen=True)
class Work:
    """What a worker is told.

    Attributes:
        job: as this server has taken it.
        limits: of the job.
        url: of the service, as workers reach it.
        token: lets a worker read files.
        version: of the planner that the service runs.
    """

    job: JobRecord
    limits: JobLimits
    url: str
    token: str = field(repr=False)
    version: str = __version__

    @property
    def name(self) -> str:
        """Name of this run of the job: another run of the same job has another fence."""
        return f"edbb-{self.job.id}-{self.job.fence}"


@dataclass(frozen=True)
class WorkEnd:
    """What came of a job.

    Attributes:
        state: in which it ended; ``None`` where it did not: its process was killed, or it was asked to stop.
        exit_code, problem: as :meth:`JobStore.finish` takes them.
        crashed: whether its process was killed from outside.
        files: what it has written, by name.
    """

    state: State | None
    exit_code: int | None = None
    problem: JobProblem | None = None
    crashed: bool = False
    files: dict[str, bytes] = field(default_factory=dict)

    def data(self) -> dict[str, object]:
        """Return it as data that the cluster carries: text, numbers and bytes in a dictionary."""
        return asdict(self)

    @classmethod
    def of(cls, data: object) -> "WorkEnd":
        """Read what a worker has sent.

        Raises:
            ValueError: it is something else, or a file has a name that leads elsewhere.
        """
        end = _ENDS.validate_python(data)
        for name in end.files:
            path = PurePosixPath(name)
            if path.is_absolute() or ".." in path.parts or any(name_fault(part) for part in path.parts):
                raise ValueError(f"'{name}' is no name of a result")
        return end


_ENDS = TypeAdapter(WorkEnd)


class WorkerJobs:
    """Stands for the store of jobs on a worker, as far as a runner needs one.

    Args:
        worker: of the cluster.
        work: what it does.
        key: of the task in the cluster.
    """

    def __init__(self, worker: Any, work: Work, key: str) -> None:
        self._worker, self._work, self._key = worker, work, key
        self.end = WorkEnd(None)
        self.outputs: list[JobOutput] = []

    def progress(self, _: JobRecord, stage: str, done: int, total: int) -> None:
        """Tell the service how far the job is."""
        self._worker.log_event(self._work.name, [stage, done, total])

    def renew(self, _: JobRecord) -> bool:
        """Do nothing: the service holds the lease as long as the cluster has the task."""
        return True

    def wants_stop(self, _: JobRecord) -> bool:
        """Tell whether nobody waits for the result any more: cancelled, or the service or the scheduler has gone."""
        task = self._worker.state.tasks.get(self._key)
        return self._worker.status.name != "running" or task is None or task.state != "executing"

    def finish(
        self, _: JobRecord, state: State, outputs: list[JobOutput], exit_code: int | None, problem: JobProblem | None
    ) -> bool:
        """Keep how the job ended."""
        self.end, self.outputs = WorkEnd(state, exit_code, problem), outputs
        return True

    def requeue(self, _: JobRecord, crashed: bool) -> None:
        """Keep that it did not end."""
        self.end = WorkEnd(None, crashed=crashed)


def run_work(work: Work) -> dict[str, object]:
    """Run a job on the worker that calls this; return what came of it, as :meth:`WorkEnd.of` reads it."""
    return _end_of(work).data()


def _end_of(work: Work) -> WorkEnd:
    from distributed import get_worker

    if work.version != __version__:
        sentence = f"the worker runs edbb {__version__}, the service {work.version}; install the same on both"
        return WorkEnd("failed", 4, JobProblem("A needed program is missing", sentence, 4))
    worker = get_worker()
    jobs = WorkerJobs(worker, work, str(worker.get_current_task()))
    with own_store(Path(worker.local_directory)) as files:
        try:
            fetch_inputs(work, files)
        except OSError as err:
            sentence = f"the worker cannot read files from {work.url} ({err}); see edbb serve --cluster-url"
            return WorkEnd("failed", None, JobProblem("A worker does not reach the service", sentence))
        runner = JobRunner(work.job, jobs, files, files.folder.parent / "jobs", work.limits)
        runner.run()
        written = {o.name: files.path(o.sha256).read_bytes() for o in jobs.outputs}
    end = jobs.end
    return WorkEnd(end.state, end.exit_code, end.problem, end.crashed, written)


@contextmanager
def own_store(folder: Path) -> Iterator[FileStore]:
    """Give a job a store of its own below a folder, which goes with it."""
    place = folder / f"edbb-{time.monotonic_ns()}"
    try:
        yield FileStore(place)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def fetch_inputs(work: Work, files: FileStore) -> None:
    """Fetch the files that a job starts from, each checked by its hash.

    Raises:
        OSError: the service does not answer, or refuses.
    """
    for sha256 in {i.sha256 for i in work.job.command.inputs}:
        request = Request(f"{work.url}/api/contents/{sha256}", headers={"authorization": f"Bearer {work.token}"})
        # 60.0: [s] without an answer
        with urlopen(request, timeout=60.0) as answer, files.receive() as draft:
            while data := answer.read(1 << 20):  # bytes at a time
                draft.add(data)
            try:
                files.keep(draft, sha256)
            except InputError as err:
                raise OSError(str(err)) from err
