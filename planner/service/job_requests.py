"""What a client may ask for: one model a kind of job; their choices are those of files and command line."""

from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from planner.common.choices import Aim, IndexName
from planner.common.schema import StrictModel

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$", description="identifier of an uploaded file")]
JobId = Annotated[str, Field(pattern="^[0-9a-f]{24}$", description="identifier of a job")]
FileName = Annotated[str, Field(pattern="^[A-Za-z0-9_][A-Za-z0-9._+-]{0,99}$", examples=["run.csv"])]
CellReference = Annotated[
    str,
    Field(
        pattern="^([a-z0-9-]{1,60}/[a-z0-9-]{1,60}|[0-9a-f]{64})$",
        description="robot/cell of a shipped cell, or the identifier of an uploaded one",
        examples=["comau-nj130/edbb"],
    ),
]
Seed = Annotated[int, Field(ge=0, le=2**31, description="the same seed gives the same bytes")]
Dialect = Annotated[str, Field(pattern="^[a-z0-9-]{1,40}$", examples=["krl"])]
FrameText = Annotated[str, Field(pattern="^-?[0-9.eE+-]{1,30}(,-?[0-9.eE+-]{1,30}){5}$", examples=["0,0,120,0,0,0"])]


Coordinate = Annotated[float, Field(ge=-50_000, le=50_000)]
FilePath = Annotated[
    str,
    Field(
        pattern="^([A-Za-z0-9_][A-Za-z0-9._+-]{0,99}/){0,4}[A-Za-z0-9_][A-Za-z0-9._+-]{0,99}$", examples=["a1/run.csv"]
    ),
]
Verb = Literal[
    "plan", "study", "export", "simulate", "identify", "import", "compensate", "accuracy", "plan-check", "check",
    "circular", "loaded", "loaded-places", "plan-both", "robots", "dialects",
]  # fmt: skip
KINDS_OF_VERBS = {  # commands whose folder holds what a job of another kind makes, by the same names
    "plan": "plan", "study": "study", "export": "export", "simulate": "simulation", "identify": "identification",
    "compensate": "compensation", "accuracy": "validation", "plan-check": "check-plan", "check": "check",
}  # fmt: skip
Word = Annotated[str, Field(max_length=500, pattern=r"^[^\x00-\x1f]*$")]


class ServiceModel(StrictModel):
    """A body of the interface."""


class FileReference(ServiceModel):
    """An uploaded file, and the name that it has in the folder of the job."""

    id: Sha256
    name: FileName


class FileInFolder(ServiceModel):
    """An uploaded file, and where it lies in the folder of the job."""

    id: Sha256
    name: FilePath


ExtraFiles = Annotated[
    list[FileReference], Field(max_length=50, description="files that an uploaded cell names: robot, URDF, meshes")
]


REQUESTS: dict[str, type["JobRequest"]] = {}
"""Every request by its kind."""
SOME_JOB, SOME_FILE = "0123456789abcdef01234567", "0" * 64


class JobRequest(ServiceModel):
    """Something that a job does.

    ``document`` is the file of its results that pages and programs read, ``example`` a request for the interface.
    """

    kind: ClassVar[str]
    document: ClassVar[str] = ""
    example: ClassVar[dict[str, Any]]

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Keep every request that has a kind."""
        if "kind" in vars(cls):
            REQUESTS[cls.kind] = cls

    @property
    def job_kind(self) -> str:
        """What the job is to a person, whoever started it."""
        return self.kind


class CellRequest(JobRequest):
    """Something that starts from a cell."""

    cell: CellReference
    files: ExtraFiles = []


class CommandRequest(JobRequest):
    """Run a command of ``edbb`` as it would run at the client's: its words, and the files that they name."""

    kind: ClassVar[str] = "command"
    example: ClassVar[dict[str, Any]] = {"words": ["plan", "comau-nj130/edbb", "--poses", "60", "-o", "out"]}
    words: Annotated[list[Word], Field(min_length=1, max_length=100)]
    files: Annotated[list[FileInFolder], Field(max_length=500)] = []
    title: Annotated[str, Field(max_length=120, pattern=r"^[^\x00-\x1f]*$", description="of what the job is")] = ""

    @property
    def job_kind(self) -> str:
        """A plan is a plan: its folder holds what one asked for here does."""
        return KINDS_OF_VERBS.get(self.words[0], self.kind)

    @model_validator(mode="after")
    def _known_verb(self) -> Self:
        if self.words[0] not in get_args(Verb):
            raise ValueError(f"'{self.words[0]}' does not run on a server; {', '.join(get_args(Verb))} do")
        for word in self.words:
            if word.startswith("/") or "=/" in word or ".." in word:
                raise ValueError(f"'{word}' leads out of the folder of the job")
        return self


class PlanRequest(CellRequest):
    """Plan a measuring session: poses, certificate, collision-free path, robot programs, report."""

    kind: ClassVar[str] = "plan"
    document: ClassVar[str] = "plan.json"
    example: ClassVar[dict[str, Any]] = {"cell": "comau-nj130/edbb", "poses": 60, "dialects": ["krl"]}
    poses: Annotated[int, Field(ge=1, le=1000)] | None = None
    index: IndexName | None = None
    seed: Seed = 0
    dialects: Annotated[list[Dialect], Field(max_length=10)] = []
    tsp: Literal["auto", "exact"] = "auto"
    separate: JobId | None = Field(
        None, description="an identification: poses that tell its findings from their rivals"
    )
    fixtures: Annotated[int, Field(ge=1, le=6)] | None = None
    aim: Aim | None = None


class StudyRequest(CellRequest):
    """Observability offline: what can be seen, with how many poses, from which fixture."""

    kind: ClassVar[str] = "study"
    example: ClassVar[dict[str, Any]] = {"cell": "comau-nj130/edbb"}
    index: IndexName | None = None
    seed: Seed = 0


class CellCheckRequest(CellRequest):
    """Check a cell, and make the view of it."""

    kind: ClassVar[str] = "cell-check"
    document: ClassVar[str] = "view.json"
    example: ClassVar[dict[str, Any]] = {"cell": "comau-nj130/edbb"}


class FixtureViewRequest(CellRequest):
    """See a cell with a fixture at another place: what is reached from there, and the error to be expected."""

    kind: ClassVar[str] = "fixture-view"
    document: ClassVar[str] = "view.json"
    example: ClassVar[dict[str, Any]] = {"cell": "comau-nj130/edbb", "position_mm": [300, 1400, 700]}
    fixture: Annotated[int, Field(ge=0, le=50, description="its number, from 0")] = 0
    position_mm: tuple[Coordinate, Coordinate, Coordinate]


class OfPlanRequest(JobRequest):
    """Something that starts from a finished plan."""

    plan: JobId


class PlanViewRequest(OfPlanRequest):
    """Make the view of a plan: poses, path and the robot along it."""

    kind: ClassVar[str] = "plan-view"
    document: ClassVar[str] = "view.json"
    example: ClassVar[dict[str, Any]] = {"plan": SOME_JOB}


class SimulationRequest(OfPlanRequest):
    """Simulate the measured run of a plan, on a robot with known or drawn errors; of a check on the calibrated one."""

    kind: ClassVar[str] = "simulation"
    example: ClassVar[dict[str, Any]] = {"plan": SOME_JOB, "seed": 1}
    seed: Seed = 0
    truth: FileReference | None = None
    change: Annotated[str, Field(pattern=r"^[a-z]+[a-z0-9_]{0,40}=-?[0-9]{1,6}(\.[0-9]{1,9})?$")] | None = Field(
        None, description="added to an error of the truth, as in theta3_deg=0.2"
    )


class ExportRequest(OfPlanRequest):
    """Write the robot program of a plan in another language."""

    kind: ClassVar[str] = "export"
    example: ClassVar[dict[str, Any]] = {"plan": SOME_JOB, "dialect": "rapid"}
    dialect: Dialect


class MeasuredRequest(JobRequest):
    """Something that starts from measured runs: uploaded, or of a simulation; the cell may be that of the plan."""

    runs: Annotated[list[FileReference], Field(max_length=20)] = []
    simulation: JobId | None = None
    plan: JobId | None = None
    cell: CellReference | None = None
    files: ExtraFiles = []

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if not self.runs and self.simulation is None:
            raise ValueError("name runs, or a simulation")
        if self.cell is None and self.plan is None:
            raise ValueError("name a plan, or a cell")
        return self


class RunCheckRequest(MeasuredRequest):
    """Read a run as an identification would, and show what is in it."""

    kind: ClassVar[str] = "run-check"
    document: ClassVar[str] = "view.json"
    example: ClassVar[dict[str, Any]] = {"runs": [{"id": SOME_FILE, "name": "run.csv"}], "plan": SOME_JOB}


class IdentificationRequest(MeasuredRequest):
    """Identify the robot from measured runs: parameters with uncertainties, errors before and after."""

    kind: ClassVar[str] = "identification"
    document: ClassVar[str] = "identification.json"
    example: ClassVar[dict[str, Any]] = {"runs": [{"id": SOME_FILE, "name": "run.csv"}], "plan": SOME_JOB}
    validate_with: FileReference | None = None
    no_trace: bool = False
    geometry: bool = False
    hold_out: Annotated[float, Field(ge=0.02, le=0.5)] = 0.2
    robust: bool = False
    seed: Seed = 0


class ErrorMapRequest(JobRequest):
    """Make the map of the error to be expected over the workspace, around the robot of the cell."""

    kind: ClassVar[str] = "error-map"
    document: ClassVar[str] = "view.json"
    example: ClassVar[dict[str, Any]] = {"identification": SOME_JOB}
    identification: JobId


class ValidationRequest(MeasuredRequest):
    """Judge a robot before and after calibration by a tracker's run, or the precision of repeated centrings."""

    kind: ClassVar[str] = "validation"
    document: ClassVar[str] = "accuracy.json"
    example: ClassVar[dict[str, Any]] = {"runs": [{"id": SOME_FILE, "name": "v.csv"}], "cell": "kuka-kr6-r700/tracker"}
    model: JobId | None = Field(None, description="the identification whose robot is judged")


class CheckPlanRequest(JobRequest):
    """Plan about ten poses that tell whether and where a calibrated robot has changed."""

    kind: ClassVar[str] = "check-plan"
    document: ClassVar[str] = "plan.json"
    example: ClassVar[dict[str, Any]] = {"identification": SOME_JOB, "poses": 10}
    identification: JobId = Field(description="the baseline")
    poses: Annotated[int, Field(ge=4, le=60)] = 10
    seed: Seed = 0
    dialects: Annotated[list[Dialect], Field(max_length=10)] = []


class CheckRequest(JobRequest):
    """Judge the run of a check: has the robot changed, where most likely, and what is to be done."""

    kind: ClassVar[str] = "check"
    document: ClassVar[str] = "check.json"
    example: ClassVar[dict[str, Any]] = {"check_plan": SOME_JOB, "run": {"id": SOME_FILE, "name": "check.csv"}}
    check_plan: JobId
    run: FileReference
    limit_mm: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="motion of the tool that is allowed"
    )


class CompensationRequest(JobRequest):
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""

    kind: ClassVar[str] = "compensation"
    example: ClassVar[dict[str, Any]] = {"program": {"id": SOME_FILE, "name": "p.src"}, "model": SOME_JOB}
    program: FileReference
    model: JobId = Field(description="the identification whose robot is used")
    dialect: Dialect | None = None
    tool: FrameText | None = None
    base: FrameText | None = None
    frames: FileReference | None = None
    strict: bool = False
