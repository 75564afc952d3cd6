"""What a client may ask for: one model a kind of job, with the command that it becomes."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from planner.common.choices import IndexName
from planner.common.errors import InputError
from planner.programs.dialect import load_dialect
from planner.service.command_words import leads_outside
from planner.service.declared_request import take_fields
from planner.service.job_folder import FileInFolder, FileReference, JobFolder, JobId
from planner.service.job_request import (
    CellRequest,
    Coordinate,
    Dialect,
    FrameText,
    JobRequest,
    MeasuredRequest,
    OfIdentificationRequest,
    OfPlanRequest,
    Seed,
    ToolText,
    Word,
    options,
)
from planner.workflow.plan_call import PlanCall

VERBS = (  # commands that run on a server
    "plan", "study", "export", "simulate", "identify", "import", "compensate", "accuracy", "plan-check", "check",
    "circular", "loaded", "loaded-places", "plan-both", "robots", "dialects",
)  # fmt: skip
TO_OUT = ("-o", "out", "--json")
MOST_TITLE = 120  # signs of a command that name it
ERROR_MAP_FILES = ("expected_error.csv", "identification.json")
SOME_JOB, SOME_FILE = "0123456789abcdef01234567", "0" * 64


class CommandRequest(JobRequest):
    """Run a command of ``edbb`` as it would run at the client's: its words, and the files that they name."""

    kind = "command"
    example = {"words": ["plan", "comau-nj130/edbb", "--poses", "60", "-o", "out"]}
    words: Annotated[list[Word], Field(min_length=1, max_length=100)]
    files: Annotated[list[FileInFolder], Field(max_length=500)] = []
    title: Annotated[str, Field(max_length=120, pattern=r"^[^\x00-\x1f]*$", description="of what the job is")] = ""

    @property
    def job_kind(self) -> str:
        """A plan is a plan: its folder holds what one asked for here does."""
        return next((r.kind for r in REQUESTS.values() if self.words[0] == (r.verb or r.kind)), self.kind)

    @model_validator(mode="after")
    def _known_verb(self) -> Self:
        if self.words[0] not in VERBS:
            raise ValueError(f"'{self.words[0]}' does not run on a server; {', '.join(VERBS)} do")
        for word in self.words:
            if leads_outside(word):
                raise ValueError(f"'{word}' leads out of the folder of the job")
        return self

    @property
    def first_word(self) -> str:
        """The command that was called."""
        return self.words[0]

    def arguments(self, folder: JobFolder) -> list[str]:
        """Lay the files where the words name them; return the words."""
        for file in self.files:
            folder.file(file)
        return self.words[1:]

    def subject(self, folder: JobFolder) -> str:
        """Return the title that the client gave, or the words."""
        return self.title or " ".join(self.words)[:MOST_TITLE]


@take_fields(PlanCall)
class PlanRequest(CellRequest):
    """What is laid into the folder of a plan beside what it declares: the cell."""

    kind = "plan"
    document = "plan.json"
    example = {"cell": "comau-nj130/edbb", "poses": 60, "dialects": ["krl"]}


class StudyRequest(CellRequest):
    """Observability offline: what can be seen, with how many poses, from which fixture."""

    kind = "study"
    example = {"cell": "comau-nj130/edbb"}
    index: IndexName | None = None
    seed: Seed = 0

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return cell and options."""
        return [*super().arguments(folder), *TO_OUT, *options(index=self.index, seed=self.seed)]


class CellCheckRequest(CellRequest):
    """Check a cell, and make the view of it."""

    kind = "cell-check"
    task = True
    document = "view.json"
    example = {"cell": "comau-nj130/edbb"}


class FixtureViewRequest(CellRequest):
    """See a cell with a fixture at another place: what is reached from there, and the error to be expected."""

    kind = "fixture-view"
    task = True
    document = "view.json"
    example = {"cell": "comau-nj130/edbb", "position_mm": [300, 1400, 700]}
    fixture: Annotated[int, Field(ge=0, le=50, description="its number, from 0")] = 0
    position_mm: tuple[Coordinate, Coordinate, Coordinate]

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the cell, the number of the fixture and its place."""
        return [*super().arguments(folder), str(self.fixture), *map(str, self.position_mm)]


class PlanViewRequest(OfPlanRequest):
    """Make the view of a plan: poses, path and the robot along it."""

    kind = "plan-view"
    task = True
    document = "view.json"
    example = {"plan": SOME_JOB}


class SimulationRequest(OfPlanRequest):
    """Simulate the measured run of a plan, on a robot with known or drawn errors; of a check on the calibrated one."""

    kind = "simulation"
    verb = "simulate"
    example = {"plan": SOME_JOB, "seed": 1}
    seed: Seed = 0
    truth: FileReference | None = None
    change: Annotated[str, Field(pattern=r"^[a-z]+[a-z0-9_]{0,40}=-?[0-9]{1,6}(\.[0-9]{1,9})?$")] | None = Field(
        None, description="added to an error of the truth, as in theta3_deg=0.2"
    )

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return plan and options; the robot of a check is the one that was calibrated."""
        plan, truth = super().arguments(folder), None
        if self.truth:
            truth = folder.file(self.truth)
        elif folder.jobs.get(self.plan).kind == "check-plan":
            truth = folder.simulated_robot_of(self.plan)
        return [*plan, "-o", "out/run.csv", *options(seed=self.seed, truth=truth, change=self.change)]


class ExportRequest(OfPlanRequest):
    """Write the robot program of a plan in another language."""

    kind = "export"
    example = {"plan": SOME_JOB, "dialect": "rapid"}
    dialect: Dialect

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the plan, the language and the file of the program."""
        program = f"out/program{load_dialect(self.dialect).extensions[0]}"
        return [*super().arguments(folder), "--dialect", self.dialect, "-o", program]


class RunCheckRequest(MeasuredRequest):
    """Read a run as an identification would, and show what is in it."""

    kind = "run-check"
    task = True
    document = "view.json"
    example = {"runs": [{"id": SOME_FILE, "name": "run.csv"}], "plan": SOME_JOB}

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the cell and the runs."""
        runs, cell, _ = self.lay_runs(folder, "check-plan")
        return [cell, *runs]


class IdentificationRequest(MeasuredRequest):
    """Identify the robot from measured runs: parameters with uncertainties, errors before and after."""

    kind = "identification"
    verb = "identify"
    document = "identification.json"
    example = {"runs": [{"id": SOME_FILE, "name": "run.csv"}], "plan": SOME_JOB}
    validate_with: FileReference | None = None
    no_trace: bool = False
    geometry: bool = False
    hold_out: Annotated[float, Field(ge=0.02, le=0.5)] = 0.2
    robust: bool = False
    seed: Seed = 0

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return runs and options."""
        runs, cell, plan = self.lay_runs(folder)
        chosen = self.model_dump(include={"no_trace", "geometry", "hold_out", "robust", "seed"})
        aside = self.validate_with and folder.file(self.validate_with)
        return [*runs, *TO_OUT, *options(plan=plan, cell=cell, **chosen, validate=aside)]


class ErrorMapRequest(OfIdentificationRequest):
    """Make the map of the error to be expected over the workspace, around the robot of the cell."""

    kind = "error-map"
    task = True
    document = "view.json"
    example = {"identification": SOME_JOB}

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the cell; the table of errors lies beside it."""
        folder.results(self.identification, "identification", "calibrated", only=ERROR_MAP_FILES)
        if len(folder.inputs) < len(ERROR_MAP_FILES):
            raise InputError(f"the identification {self.identification} has no expected errors")
        return [folder.cell_of(self.identification)]


class ValidationRequest(MeasuredRequest):
    """Judge a robot before and after calibration by a tracker's run, or the precision of repeated centrings."""

    kind = "validation"
    verb = "accuracy"
    document = "accuracy.json"
    example = {"runs": [{"id": SOME_FILE, "name": "v.csv"}], "cell": "kuka-kr6-r700/tracker"}
    model: JobId | None = Field(None, description="the identification whose robot is judged")

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the run and options.

        Raises:
            InputError: it is not one run.
        """
        runs, cell, plan = self.lay_runs(folder)
        if len(runs) != 1:
            raise InputError(f"a validation is of one run, found {len(runs)}")
        model = self.model and f"{folder.results(self.model, 'identification', 'calibrated')}/robot.toml"
        return [*runs, *TO_OUT, *options(plan=plan, cell=cell, model=model)]


class CheckPlanRequest(OfIdentificationRequest):
    """Plan about ten poses that tell whether and where a calibrated robot has changed."""

    kind = "check-plan"
    verb = "plan-check"
    document = "plan.json"
    example = {"identification": SOME_JOB, "poses": 10}
    identification: JobId = Field(description="the baseline")
    poses: Annotated[int, Field(ge=4, le=60)] = 10
    seed: Seed = 0
    dialects: Annotated[list[Dialect], Field(max_length=10)] = []

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the cell that was identified in, and options."""
        cell = folder.cell_of(self.identification)
        known = folder.results(self.identification, "identification", "calibrated")
        chosen = options(baseline=known, poses=self.poses, seed=self.seed, dialect=self.dialects)
        return [cell, *TO_OUT, *chosen]


class CheckRequest(JobRequest):
    """Judge the run of a check: has the robot changed, where most likely, and what is to be done."""

    kind = "check"
    document = "check.json"
    example = {"check_plan": SOME_JOB, "run": {"id": SOME_FILE, "name": "check.csv"}}
    check_plan: JobId
    run: FileReference
    limit_mm: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="motion of the tool that is allowed"
    )

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the run and options."""
        plan = f"{folder.results(self.check_plan, 'check-plan', 'check')}/plan.json"
        run, known = folder.file(self.run), folder.baseline_of(self.check_plan)
        return [run, *TO_OUT, *options(plan=plan, baseline=known, limit_mm=self.limit_mm)]

    def subject(self, folder: JobFolder) -> str:
        """Return the name of the run, and where it was measured."""
        return f"{self.run.name} of {folder.place(self.check_plan)}"


class CompensationRequest(JobRequest):
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""

    kind = "compensation"
    verb = "compensate"
    example = {"program": {"id": SOME_FILE, "name": "p.src"}, "model": SOME_JOB}
    program: FileReference
    model: JobId = Field(description="the identification whose robot is used")
    dialect: Dialect | None = None
    tool: ToolText | None = None
    base: FrameText | None = None
    frames: FileReference | None = None
    strict: bool = False
    again: bool = Field(False, description="add to the correction by another model, whose mark the file bears")
    measuring: bool = Field(False, description="correct a measuring program of a plan, too")

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the program and options."""
        program = folder.file(self.program)
        model = f"{folder.results(self.model, 'identification', 'calibrated')}/robot.toml"
        chosen = self.model_dump(include={"dialect", "tool", "base", "strict", "again", "measuring"})
        frames = self.frames and folder.file(self.frames)
        return [program, "-o", f"out/{program}", *options(model=model, **chosen, frames=frames)]

    def subject(self, folder: JobFolder) -> str:
        """Return the name of the program."""
        return self.program.name


KINDS: tuple[type[JobRequest], ...] = (
    CommandRequest,
    PlanRequest,
    StudyRequest,
    CellCheckRequest,
    FixtureViewRequest,
    PlanViewRequest,
    SimulationRequest,
    ExportRequest,
    RunCheckRequest,
    IdentificationRequest,
    ErrorMapRequest,
    ValidationRequest,
    CheckPlanRequest,
    CheckRequest,
    CompensationRequest,
)
REQUESTS = {r.kind: r for r in KINDS}
"""Every request by its kind."""
