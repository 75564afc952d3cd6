"""What a client may ask for: one model a kind of job, with the command that it becomes."""

from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from planner.cell.reading import shipped_cells
from planner.common.errors import InputError
from planner.programs.dialect import load_dialect
from planner.service.command_words import RefusedCommandError, leads_outside
from planner.service.declared_request import take_fields
from planner.service.job_folder import FileInFolder, FileReference, JobFolder, JobId
from planner.service.job_request import (
    GIVEN,
    PLAN_OR_CELL,
    CellReference,
    CellRequest,
    Coordinate,
    ExtraFiles,
    JobRequest,
    MeasuredRequest,
    OfIdentificationRequest,
    OfPlanRequest,
    Word,
    options,
    schema_of_one_key,
    schema_of_one_run,
)
from planner.studies.study_call import StudyCall
from planner.workflow.accuracy_call import AccuracyCall
from planner.workflow.check_calls import CheckCall, PlanCheckCall
from planner.workflow.compensate_call import CompensateCall
from planner.workflow.core_calls import ExportCall, IdentifyCall, PlanCall, SimulateCall
from planner.workflow.verbs import declared_calls

VERBS = (*declared_calls(), "robots", "dialects")  # commands that run on a server
SOME_JOB, SOME_FILE = "0123456789abcdef01234567", "0" * 64  # ids that stand in examples of requests


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
    def _check_verb(self) -> Self:
        if self.words[0] not in VERBS:
            raise RefusedCommandError(f"'{self.words[0]}' does not run on a server; {', '.join(VERBS)} do")
        for word in self.words:
            if leads_outside(word):
                raise RefusedCommandError(f"'{word}' leads out of the folder of the job")
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
        return self.title or " ".join(self.words)[:120]  # signs of a command that name it

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of a shipped cell among the words."""
        return next((w.partition("/")[0] for w in self.words if w in shipped_cells()), "")


@take_fields(PlanCall)
class PlanRequest(JobRequest):
    """What is laid into the folder of a plan beside what it declares: the cell, or that of the calibration before."""

    kind = "plan"
    document = "plan.json"
    example = {"cell": "comau-nj130/edbb", "poses": 60, "dialect": ["krl"]}
    cell: CellReference | None = None
    files: ExtraFiles = []
    after: JobId | None = Field(
        None,
        description="the identification of the robot: poses that lower the error that it leaves most; without a cell"
        " they are planned in its own",
    )
    model_config = ConfigDict(json_schema_extra=schema_of_one_key(cell=GIVEN, after=GIVEN))

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        if self.cell is None and self.after is None:
            raise ValueError("name a cell, or with after a calibration")
        return self

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the word of the cell, and the calibrated robot."""
        cell = folder.cell(self.cell, self.files) if self.cell else folder.cell_of(str(self.after))
        after = self.after and folder.results(self.after, "identification", "calibrated")
        return [cell, *options(after=after)]

    def subject(self, folder: JobFolder) -> str:
        """Return the title of the cell, or what the calibration was of."""
        return folder.cell_title(self.cell) if self.cell else folder.place(str(self.after))

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of the cell."""
        return folder.robot(self.cell) if self.cell else folder.jobs.get(str(self.after)).robot


@take_fields(StudyCall)
class StudyRequest(CellRequest):
    """What a study has beside what it declares: the cell."""

    kind = "study"
    example = {"cell": "comau-nj130/edbb"}


class PlanUploadRequest(JobRequest):
    """Take a plan that was made elsewhere: its job is a plan like one made here."""

    kind = "plan-upload"
    in_service = True
    example = {"files": [{"id": SOME_FILE, "name": "plan.json"}, {"id": SOME_FILE, "name": "cell.toml"}]}
    files: Annotated[
        list[FileInFolder],
        Field(max_length=500, description="plan.json, cell.toml and the files that the cell names, as they lie there"),
    ]
    title: Annotated[str, Field(max_length=120, pattern=r"^[^\x00-\x1f]*$", description="of what the plan is")] = ""

    @property
    def job_kind(self) -> str:
        """A plan, wherever it was made."""
        return PlanRequest.kind

    def arguments(self, folder: JobFolder) -> list[str]:
        """Lay the files into a folder; return the path of the plan."""
        for file in self.files:
            folder.file(file, "plan/")
        return ["plan/plan.json"]

    def subject(self, folder: JobFolder) -> str:
        """Return the title that was given, or the robot."""
        return self.title or self.robot(folder) or "plan.json"

    def robot(self, folder: JobFolder) -> str:
        """Return the robot of the cell."""
        return next((folder.robot(f.id) for f in self.files if f.name == "cell.toml"), "")


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


@take_fields(SimulateCall)
class SimulationRequest(OfPlanRequest):
    """What a simulation has beside what it declares: the plan, and whose errors are true."""

    kind = "simulation"
    example = {"plan": SOME_JOB, "seed": 1}
    truth: FileReference | None = None

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return plan and truth; the robot of a check is the one that was calibrated."""
        plan, truth = super().arguments(folder), None
        if self.truth:
            truth = folder.file(self.truth)
        elif folder.jobs.get(self.plan).kind == "check-plan":
            truth = folder.simulated_robot_of(self.plan)
        return [*plan, *options(truth=truth)]

    def output_words(self) -> tuple[str, ...]:
        """Return the words for the file of the run."""
        return ("-o", "out/run.csv")


@take_fields(ExportCall)
class ExportRequest(OfPlanRequest):
    """What an export has beside what it declares: the plan."""

    kind = "export"
    example = {"plan": SOME_JOB, "dialect": "rapid"}

    def output_words(self) -> tuple[str, ...]:
        """Return the words for the file of the program."""
        return ("-o", f"out/program{load_dialect(str(self.value_of('dialect'))).extensions[0]}")


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


@take_fields(IdentifyCall)
class IdentificationRequest(MeasuredRequest):
    """What an identification has beside what it declares: runs, plan and cell."""

    kind = "identification"
    document = "identification.json"
    example = {"runs": [{"id": SOME_FILE, "name": "run.csv"}], "plan": SOME_JOB}
    plans: Annotated[list[JobId], Field(max_length=20)] = Field(
        [], description="the plans of the runs after the first, where each is a session of its own, in their order"
    )

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the runs, and what they were measured with: one plan and cell for all, or one for each."""
        if not self.plans:
            return super().arguments(folder)
        runs, cell, plan = self.lay_runs(folder)
        more = [folder.results(job, "plan", f"plan-{k}") for k, job in enumerate(self.plans, start=2)]
        plans = [plan or "plan/plan.json", *(f"{own}/plan.json" for own in more)]
        return [*runs, *options(plan=plans, cell=[cell, *(f"{own}/cell.toml" for own in more)])]


@take_fields(AccuracyCall)
class ValidationRequest(MeasuredRequest):
    """What a validation has beside what it declares: run, plan and cell."""

    kind = "validation"
    document = "accuracy.json"
    model_config = ConfigDict(json_schema_extra={"allOf": [schema_of_one_run(), PLAN_OR_CELL]})
    example = {"runs": [{"id": SOME_FILE, "name": "v.csv"}], "cell": "kuka-kr6-r700/tracker"}

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the run and what it was measured with.

        Raises:
            InputError: it is not one run.
        """
        many = len(self.runs) + (self.simulation is not None)
        if many != 1:
            raise InputError(f"a validation is of one run, found {many}")
        return super().arguments(folder)


@take_fields(PlanCheckCall, "cell")
class CheckPlanRequest(OfIdentificationRequest):
    """What the plan of a check has beside what it declares: the calibration, and its cell."""

    kind = "check-plan"
    document = "plan.json"
    example = {"model": SOME_JOB, "poses": 10}

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the cell that was identified in, and the calibrated robot."""
        cell = folder.cell_of(self.model)
        known = folder.results(self.model, "identification", "calibrated")
        return [cell, *options(model=known)]


@take_fields(CheckCall, "model", "plan", "cell")
class CheckRequest(JobRequest):
    """A request for a check: the fields of its declaration, the plan (with the calibration) and the run."""

    kind = "check"
    document = "check.json"
    example = {"plan": SOME_JOB, "run": {"id": SOME_FILE, "name": "check.csv"}}
    plan: Annotated[JobId, Field(description="of the check")]
    run: FileReference

    def arguments(self, folder: JobFolder) -> list[str]:
        """Return the run, its plan and the calibrated robot."""
        plan = f"{folder.results(self.plan, 'check-plan', 'check')}/plan.json"
        run, known = folder.file(self.run), folder.baseline_of(self.plan)
        return [run, *options(plan=plan, model=known)]

    def subject(self, folder: JobFolder) -> str:
        """Return the name of the run, and where it was measured."""
        return f"{self.run.name} of {folder.place(self.plan)}"

    def robot(self, folder: JobFolder) -> str:
        """Return the robot that is checked."""
        return folder.jobs.get(self.plan).robot


@take_fields(CompensateCall)
class CompensationRequest(JobRequest):
    """What a compensation has beside what it declares: the program, and the other files of it."""

    kind = "compensation"
    example = {"program": {"id": SOME_FILE, "name": "p.src"}, "model": SOME_JOB}
    program: FileReference
    files: Annotated[
        list[FileReference],
        Field(
            max_length=50,
            description="the other files of the program, corrected along with it (.dat of a .src, modules), and those"
            " that an uploaded cell names",
        ),
    ] = []
    cell: CellReference | None = None

    def arguments(self, folder: JobFolder) -> list[str]:
        """Lay the other files of the program, and the cell, beside it; return their words."""
        for file in self.files:
            folder.file(file)
        return [folder.file(self.program), *options(cell=self.cell and folder.cell(self.cell, []))]

    def output_words(self) -> tuple[str, ...]:
        """Return the words for the folder of the corrected files."""
        return ("-o", "out/")

    def subject(self, folder: JobFolder) -> str:
        """Return the name of the program."""
        return self.program.name


KINDS: tuple[type[JobRequest], ...] = (
    CommandRequest,
    PlanRequest,
    PlanUploadRequest,
    StudyRequest,
    CellCheckRequest,
    FixtureViewRequest,
    PlanViewRequest,
    SimulationRequest,
    ExportRequest,
    RunCheckRequest,
    IdentificationRequest,
    ValidationRequest,
    CheckPlanRequest,
    CheckRequest,
    CompensationRequest,
)
REQUESTS = {r.kind: r for r in KINDS}
"""Every request by its kind."""
