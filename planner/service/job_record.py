"""A job as it is kept: what it runs, how it stands, what it has written, and what happened to it.

Which jobs a list holds, and where in it a page ends.
"""

import re
from dataclasses import dataclass
from typing import Literal

from pydantic.dataclasses import dataclass as model

from planner.common.errors import InputError

PLACE = r"([0-9]{1,12}\.[0-9]{1,9})-([0-9a-f]{24})"  # in a list, as text
State = Literal["queued", "running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class JobPlace:
    """A place in the list of jobs, which is ordered by the time of submission, the latest first.

    Attributes:
        created: when the last job before it was submitted [s since 1970].
        id: of that job.
    """

    created: float
    id: str

    @classmethod
    def parse(cls, text: str) -> "JobPlace":
        """Read a place as ``str`` writes it.

        Raises:
            InputError: it is none.
        """
        found = re.fullmatch(PLACE, text)
        if found is None:
            raise InputError(f"after: '{text}' is no place in a list; take it from the Link header of the page before")
        return cls(float(found[1]), found[2])

    def __str__(self) -> str:
        return f"{self.created!r}-{self.id}"


SERIALS = """
SELECT outputs.job AS job, serial FROM recorded JOIN outputs ON outputs.sha256 = document_sha256 WHERE withdrawn = 0
UNION SELECT inputs.job, serial FROM recorded JOIN inputs ON inputs.sha256 = document_sha256 WHERE withdrawn = 0
UNION SELECT plan, serial FROM cell_sessions WHERE serial != ''
"""
"""Jobs with the serial numbers of their robots: whose results a record holds, that start from one, whose plan it is."""
OF_SERIAL = f"SELECT job FROM ({SERIALS}) WHERE instr(lower(serial), ?) > 0"
OF_TEXT = f"(instr(lower(title || ' ' || note), ?) > 0 OR id IN ({OF_SERIAL}))"


@dataclass(frozen=True)
class JobFilter:
    """What is wanted of jobs; nothing where all are.

    Attributes:
        kind: of the job; without one the short tasks of pages are left out, unless ``tasks`` says otherwise.
        state: how far it is.
        robot: model of the robot.
        person: who asked for it.
        text: stands in title, note, or the serial number of its robot.
        since, until: when it was submitted [s since 1970].
        tasks: whether the tasks of pages (views, checks of cells) are in the list of all kinds.
        archived: whether those are wanted that were put aside, or the others; both where it is ``None``.
    """

    kind: str | None = None
    state: State | None = None
    robot: str | None = None
    text: str = ""
    since: float | None = None
    until: float | None = None
    tasks: bool = False
    archived: bool | None = None
    person: str | None = None

    def condition(self) -> tuple[str, tuple[object, ...]]:
        """Return the condition of a query, and the values of its places."""
        parts: list[tuple[str, object]] = [
            ("kind = ?", self.kind), ("state = ?", self.state), ("robot = ?", self.robot), ("created >= ?", self.since),
            ("created < ?", self.until), (OF_TEXT, self.text.lower() or None),
            ("task = ?", None if self.kind or self.tasks else 0), ("archived = ?", self.archived),
            ("id IN (SELECT job FROM askers WHERE person = ?)", self.person),
        ]  # fmt: skip
        given = [(text, value) for text, value in parts if value is not None]
        values = (v for text, value in given for v in [value] * text.count("?"))
        return " AND ".join(["1", *(text for text, _ in given)]), tuple(values)


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
        """Return the inputs that a calibrated robot is, hash by name."""
        return self.inputs_of("--model")

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
