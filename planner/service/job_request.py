"""What every request for a job is: it lays files into a folder and becomes a command; and what requests start from."""

import hashlib
import json
from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Self

from pydantic import AliasChoices, ConfigDict, Field, model_validator

from planner import __version__
from planner.common.calls import JobFile, ServedField
from planner.common.schema import StrictModel
from planner.service.job_folder import FileReference, JobFolder, JobId
from planner.service.job_record import JobCommand

CellReference = Annotated[
    str,
    Field(
        pattern="^([a-z0-9-]{1,60}/[a-z0-9-]{1,60}|[0-9a-f]{64})$",
        description="robot/cell of a shipped cell, or the identifier of an uploaded one",
        examples=["comau-nj130/edbb"],
    ),
]
Coordinate = Annotated[float, Field(ge=-50_000, le=50_000)]
Word = Annotated[str, Field(max_length=500, pattern=r"^[^\x00-\x1f]*$")]
ExtraFiles = Annotated[
    list[FileReference], Field(max_length=50, description="files that an uploaded cell names: robot, URDF, meshes")
]

CALIBRATED_NAMES = AliasChoices("model", "identification")  # the second: of the version before


class JobRequest(StrictModel, ABC):
    """Something that a job does.

    ``verb`` is the command that does it, or the task of the service, where that is not the kind. Of a ``task`` a page
    waits for the result; ``in_service``: a task whose job a person sees. ``declared``: the
    fields that the verb's declaration gives; ``document`` the file of its results that pages and programs read,
    ``example`` a request for the interface.
    """

    kind: ClassVar[str]
    verb: ClassVar[str] = ""
    task: ClassVar[bool] = False
    in_service: ClassVar[bool] = False
    declared: ClassVar[tuple[ServedField, ...]] = ()
    document: ClassVar[str] = ""
    example: ClassVar[dict[str, Any]]

    @property
    def job_kind(self) -> str:
        """What the job is to a person, whoever started it."""
        return self.kind

    @property
    def first_word(self) -> str:
        """The command that does it, or the service's task."""
        return self.verb or self.kind

    def command(self, folder: JobFolder) -> JobCommand:
        """Lay the files into the folder of the job; return the command with them.

        Raises:
            InputError: a file or a job that the request names is not there, or two files have one name.
        """
        words = [self.first_word, *self.arguments(folder)]
        if self.declared:
            words += [*self.output_words(), *self._declared_words(folder)]
        return JobCommand(tuple(words), folder.inputs, self.task, self.in_service)

    @abstractmethod
    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the words after the first."""

    def value_of(self, name: str) -> object:
        """Return the value of a declared field."""
        return getattr(self, name)

    def output_words(self) -> tuple[str, ...]:
        """Return the words that say where the results go."""
        return ("-o", "out", "--json")

    def _declared_words(self, folder: JobFolder) -> list[str]:
        """Return the options that are given, and lay the files that they name into the folder of the job."""
        given = [(s, getattr(self, s.name)) for s in self.declared]
        return [w for s, value in given if value is not None for w in _option_words(s, value, folder)]

    @abstractmethod
    def subject(self, folder: JobFolder) -> str:
        """Return what the job works on, in words for a person."""

    def robot(self, folder: JobFolder) -> str:
        """Return the model of the robot that it is of, where that is known."""
        return ""

    def job_id(self, command: JobCommand) -> str:
        """Return the identifier of the job: a hash of what is asked for, of its files and the planner's version."""
        asked = json.loads(self.model_dump_json(exclude={"title"}, exclude_none=True))
        content = [self.kind, asked, [[i.name, i.sha256] for i in command.inputs], __version__]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:24]


def _option_words(served: ServedField, value: object, folder: JobFolder) -> list[str]:
    """Return an option with its value, as often as it has one; a file that it names is laid in."""
    source, flag = served.option.from_service, served.field.flag
    if isinstance(source, JobFile):
        _ = folder.results(str(value), source.kind, source.folder, source.also)
        return [flag, source.word]
    if isinstance(value, FileReference):
        return [flag, folder.file(value)]
    if isinstance(value, bool):
        return [flag] if value else []
    return [w for v in (value if isinstance(value, list) else [value]) for w in (flag, str(v))]


def options(**values: object) -> list[str]:
    """Return words of the command line for options: one a value, one for each entry of a list, switches if set."""
    words = []
    for name, value in values.items():
        option = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            words += [w for v in (value if isinstance(value, list) else [value]) for w in (option, str(v))]
    return words


class CellRequest(JobRequest):
    """Something that starts from a cell."""

    cell: CellReference
    files: ExtraFiles = []

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the word of the cell."""
        return [folder.cell(self.cell, self.files)]

    def subject(self, folder: JobFolder) -> str:
        """Return the title of the cell."""
        return folder.cell_title(self.cell)

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of the cell."""
        return folder.robot(self.cell)


class OfPlanRequest(JobRequest):
    """Something that starts from a finished plan."""

    plan: JobId

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the word of the plan."""
        return [folder.plan(self.plan)]

    def subject(self, folder: JobFolder) -> str:
        """Return the title of the plan's job."""
        return folder.jobs.get(self.plan).title

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of the plan."""
        return folder.jobs.get(self.plan).robot


def schema_of_one_key(**schemas: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of an object that has one of some keys, as it is described."""
    return {"anyOf": [{"required": [key], "properties": {key: schema}} for key, schema in schemas.items()]}


def schema_of_one_run() -> dict[str, Any]:
    """Return the schema of a request with either one file, or a simulation."""
    one, none = {"minItems": 1, "maxItems": 1}, {"maxItems": 0}
    runs = {"required": ["runs"], "properties": {"runs": one, "simulation": {"type": "null"}}}
    simulation = {"required": ["simulation"], "properties": {"simulation": {"type": "string"}, "runs": none}}
    return {"oneOf": [runs, simulation]}


GIVEN = {"type": "string"}
RUNS_OR_SIMULATION = schema_of_one_key(runs={"type": "array", "minItems": 1}, simulation=GIVEN)
PLAN_OR_CELL = schema_of_one_key(plan=GIVEN, cell=GIVEN)


class MeasuredRequest(JobRequest):
    """Something that starts from measured runs: uploaded, or of a simulation; the cell may be that of the plan."""

    runs: Annotated[list[FileReference], Field(max_length=20)] = []
    simulation: JobId | None = None
    plan: JobId | None = None
    cell: CellReference | None = None
    files: ExtraFiles = []
    model_config = ConfigDict(json_schema_extra={"allOf": [RUNS_OR_SIMULATION, PLAN_OR_CELL]})

    @model_validator(mode="after")
    def _check_complete(self) -> Self:
        if not self.runs and self.simulation is None:
            raise ValueError("name runs, or a simulation")
        if self.cell is None and self.plan is None:
            raise ValueError("name a plan, or a cell")
        return self

    def lay_runs(self, folder: JobFolder, also: str = "") -> tuple[list[str], str, str | None]:
        """Copy runs, cell and plan into the folder; return their names. The plan may be of the kind ``also``."""
        runs = [folder.file(f) for f in self.runs]
        if self.cell is None:
            for file in self.files:
                folder.file(file)
        if self.simulation:
            made = folder.results(self.simulation, "simulation", "simulated", only=("run.csv",))
            runs.append(f"{made}/run.csv")
        plan = self.plan and f"{folder.results(self.plan, 'plan', 'plan', also)}/plan.json"
        cell = "plan/cell.toml" if self.cell is None else folder.cell(self.cell, self.files)
        return runs, cell, plan

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the runs, and what they were measured with."""
        runs, cell, plan = self.lay_runs(folder)
        return [*runs, *options(plan=plan, cell=cell)]

    def subject(self, folder: JobFolder) -> str:
        """Return the names of the runs, and of their plan or cell."""
        if not self.runs:
            return f"simulated run of {folder.jobs.get(str(self.simulation)).title}"
        place = folder.place(self.plan) if self.plan else folder.cell_title(str(self.cell))
        return f"{', '.join(r.name for r in self.runs)} of {place}"

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of the plan, or of the cell."""
        return folder.jobs.get(self.plan).robot if self.plan else folder.robot(str(self.cell))


class OfIdentificationRequest(JobRequest):
    """Something that starts from a finished identification."""

    model: Annotated[JobId, Field(description="the identification", validation_alias=CALIBRATED_NAMES)]

    def subject(self, folder: JobFolder) -> str:
        """Return where it was identified."""
        return folder.place(self.model)

    def robot(self, folder: JobFolder) -> str:
        """Return the robot that was identified."""
        return folder.jobs.get(self.model).robot
