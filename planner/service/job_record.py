"""A job as it is kept: what it runs, how it stands, what it has written, and what happened to it."""

from dataclasses import dataclass

from pydantic.dataclasses import dataclass as model

from planner.service.job_filter import State


@model(frozen=True)
class JobInput:
    """A file of the store, laid into the folder of the job under a name."""

    name: str
    sha256: str


@model(frozen=True)
class JobCommand:
    """What a job runs: words after ``edbb``, or a task of the service; of a ``task`` a page waits for the result."""

    words: tuple[str, ...]
    inputs: tuple[JobInput, ...] = ()
    task: bool = False
    in_service: bool = False

    @property
    def module(self) -> str:
        """Return the module that runs it."""
        return "planner.service.tasks" if self.task or self.in_service else "planner.cli"

    def option(self, name: str) -> str | None:
        """Return the word of an option, ``None`` where it is not given."""
        words = (w.partition("=") for w in self.words)
        after = dict(zip(self.words, self.words[1:], strict=False)).get(name)
        return next((value for key, equals, value in words if equals and key == name), after)

    def calibrated_inputs(self) -> dict[str, str]:
        """Return the inputs that a calibrated robot is, hash by name; jobs of earlier versions call it a baseline."""
        return self.inputs_of("--model") or self.inputs_of("--baseline")

    def inputs_of(self, option: str) -> dict[str, str]:
        """Return the inputs that an option names, hash by name: its file, or what lies in its folder."""
        place = f"{self.option(option)}"
        return {
            i.name.rpartition("/")[2] if i.name == place else i.name[len(place) + 1 :]: i.sha256
            for i in self.inputs
            if i.name == place or i.name.startswith(f"{place}/")
        }


@model(frozen=True)
class JobOutput:
    """A file that a job has written."""

    name: str
    sha256: str
    size: int


@model(frozen=True)
class JobProblem:
    """Why a job has no result, as the command line says it."""

    title: str
    detail: str
    exit_code: int | None = None


@dataclass(frozen=True)
class JobRecord:
    """A job as it stands in the store; times in seconds since 1970."""

    id: str
    kind: str
    title: str
    robot: str
    request: str
    command: JobCommand
    state: State
    fence: int
    crashes: int
    cancelled: bool
    stage: str
    done: int
    total: int
    created: float
    started: float | None
    finished: float | None
    exit_code: int | None
    problem: JobProblem | None
    version: str
    note: str
    archived: bool
    person: str

    @property
    def ended(self) -> bool:
        """Whether nothing more happens to it."""
        return self.state in ("done", "failed", "cancelled")

    @property
    def is_tried_again(self) -> bool:
        """Whether it is run again when the same is asked for."""
        may_succeed = (None, 1, 4)  # exit codes: killed, a mistake, a missing program
        return self.state == "cancelled" or (self.state == "failed" and self.exit_code in may_succeed)


@dataclass(frozen=True)
class JobEvent:
    """Something that happened to a job; numbers rise over all jobs."""

    id: int
    job: str
    kind: str
    content: str
    at: float
