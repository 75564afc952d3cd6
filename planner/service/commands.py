"""From a request to the words of the command line and the files that it needs."""

import hashlib
import json
from collections.abc import Callable, Sequence

import planner.service.job_requests as ask
from planner.common.errors import InputError
from planner.programs.dialect import load_dialect
from planner.runs.run import SIMULATED
from planner.service.file_store import FileStore, UploadList
from planner.service.job_requests import FileInFolder, FileReference, JobRequest
from planner.service.job_store import JobCommand, JobInput, JobRecord, JobStore

JSON = "--json"
HEAD = 65536  # bytes of a run that its comments are sought in
TITLE = 120  # signs of a command that name it
NOT_NEEDED = ("pictures/", "report.html", "residuals.csv", "printed", "log", "timings.json", "manifest.json")


class UnknownJobError(InputError):
    """A job that a request names is not there."""


class UnfinishedJobError(InputError):
    """A job that a request names has no result."""


class CommandBuilder:
    """Makes commands of requests; refuses what names files or jobs that are not there."""

    def __init__(self, jobs: JobStore, files: FileStore, uploads: UploadList) -> None:
        self._jobs, self._files, self._uploads = jobs, files, uploads
        self._makers: dict[type[JobRequest], Callable[..., JobCommand]] = {
            ask.CommandRequest: self._command,
            ask.PlanRequest: self._plan,
            ask.StudyRequest: self._study,
            ask.CellCheckRequest: self._cell_check,
            ask.FixtureViewRequest: self._fixture_view,
            ask.PlanViewRequest: self._plan_view,
            ask.SimulationRequest: self._simulation,
            ask.ExportRequest: self._export,
            ask.RunCheckRequest: self._run_check,
            ask.IdentificationRequest: self._identification,
            ask.ErrorMapRequest: self._error_map,
            ask.CheckPlanRequest: self._check_plan,
            ask.CheckRequest: self._check,
            ask.ValidationRequest: self._validation,
            ask.CompensationRequest: self._compensation,
        }

    def submit(self, request: JobRequest) -> JobRecord:
        """Accept a request as a job; the same content is the same job.

        Raises:
            InputError: a file or a job that it names is not there, or two files have one name.
        """
        command = self._makers[type(request)](request)
        names = [i.name for i in command.inputs]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice:
            raise InputError(f"two files of the request are called '{twice}'; give them names of their own")
        return self._jobs.submit(
            job_id(request, command), request.job_kind, self._title(request), request.model_dump_json(), command
        )

    def _title(self, request: JobRequest) -> str:
        if isinstance(request, ask.CellRequest):
            return self._cell_title(request.cell)
        if isinstance(request, ask.MeasuredRequest):
            simulated = f"simulated run of {self._jobs.get(request.simulation).title}" if request.simulation else ""
            place = self._place(request.plan) if request.plan else self._cell_title(str(request.cell))
            return f"{', '.join(r.name for r in request.runs)} of {place}" if request.runs else simulated
        if isinstance(request, ask.CommandRequest):
            return request.title or " ".join(request.words)[:TITLE]
        if isinstance(request, ask.CompensationRequest):
            return request.program.name
        if isinstance(request, ask.CheckRequest):
            return f"{request.run.name} of {self._place(request.check_plan)}"
        if isinstance(request, ask.ErrorMapRequest | ask.CheckPlanRequest):
            return self._place(request.identification)
        return self._jobs.get(str(getattr(request, "plan"))).title  # noqa: B009

    def _cell_title(self, cell: str) -> str:
        sent = None if "/" in cell else self._uploads.find(cell)
        return sent.name if sent else cell

    def _place(self, job: str) -> str:
        """What a job was for, without the names of runs."""
        return self._jobs.get(job).title.rpartition(" of ")[2]

    def _command(self, r: ask.CommandRequest) -> JobCommand:
        return JobCommand(tuple(r.words), tuple(self._file(f) for f in r.files))

    def _plan(self, r: ask.PlanRequest) -> JobCommand:
        cell, inputs = self._cell(r.cell, r.files)
        words = ["plan", cell, "-o", "out", JSON, "--seed", str(r.seed), "--tsp", r.tsp]
        words += _options(poses=r.poses, index=r.index, fixtures=r.fixtures, aim=r.aim)
        words += [w for d in r.dialects for w in ("--dialect", d)]
        if r.separate:
            found = self._results(r.separate, "identification", "before")
            words, inputs = [*words, "--separate", "before/identification.json"], [*inputs, *found]
        return JobCommand(tuple(words), tuple(inputs))

    def _study(self, r: ask.StudyRequest) -> JobCommand:
        cell, inputs = self._cell(r.cell, r.files)
        words = ["study", cell, "-o", "out", JSON, "--seed", str(r.seed), *_options(index=r.index)]
        return JobCommand(tuple(words), tuple(inputs))

    def _cell_check(self, r: ask.CellCheckRequest) -> JobCommand:
        cell, inputs = self._cell(r.cell, r.files)
        return JobCommand(("cell-check", cell), tuple(inputs), task=True)

    def _fixture_view(self, r: ask.FixtureViewRequest) -> JobCommand:
        cell, inputs = self._cell(r.cell, r.files)
        return JobCommand(("fixture-view", cell, str(r.fixture), *map(str, r.position_mm)), tuple(inputs), task=True)

    def _plan_view(self, r: ask.PlanViewRequest) -> JobCommand:
        return JobCommand(("plan-view",), tuple(self._plan_files(r.plan)), task=True)

    def _simulation(self, r: ask.SimulationRequest) -> JobCommand:
        inputs = self._plan_files(r.plan)
        words = ["simulate", "plan/plan.json", "-o", "out/run.csv", "--seed", str(r.seed)]
        if r.truth:
            words, inputs = [*words, "--truth", r.truth.name], [*inputs, self._file(r.truth)]
        elif self._jobs.get(r.plan).kind == "check-plan":
            words, inputs = [*words, "--truth", "robot.csv"], [*inputs, self._simulated_baseline(r.plan)]
        return JobCommand((*words, *_options(change=r.change)), tuple(inputs))

    def _simulated_baseline(self, check_plan: str) -> JobInput:
        """The simulated run by which the robot of a check was calibrated: it says what is true of that robot."""
        known = self._jobs.get(check_plan).command.inputs_of("--baseline").get("identification.json", "")
        made = self._jobs.writer(known, "identification")
        runs = [i for i in made.command.inputs if i.name in made.command.words] if made else []
        for run in (i for i in runs if i.name.endswith(".csv")):
            with self._files.path(run.sha256).open("rb") as file:
                if SIMULATED.encode() in file.read(HEAD):
                    return JobInput("robot.csv", run.sha256)
        raise InputError(
            "a check can be simulated only for a robot whose calibration was simulated, as only then its true errors "
            "are known; drive the check and give its log"
        )

    def _export(self, r: ask.ExportRequest) -> JobCommand:
        inputs = self._plan_files(r.plan)
        suffix = load_dialect(r.dialect).extensions[0]
        return JobCommand(
            ("export", "plan/plan.json", "--dialect", r.dialect, "-o", f"out/program{suffix}"), tuple(inputs)
        )

    def _measured_files(self, r: ask.MeasuredRequest, also: str = "") -> tuple[list[str], list[str], list[JobInput]]:
        """Runs, then the options of cell and plan, then all files."""
        inputs = [self._file(f) for f in (*r.runs, *(r.files if r.cell is None else ()))]
        runs = [f.name for f in r.runs]
        if r.simulation:
            inputs += [i for i in self._results(r.simulation, "simulation", "simulated") if i.name.endswith("run.csv")]
            runs.append("simulated/run.csv")
        options = []
        if r.plan:
            inputs += self._results(r.plan, "plan", "plan", also)
            options += ["--plan", "plan/plan.json"]
        if r.cell is None:
            options += ["--cell", "plan/cell.toml"]
        else:
            cell, found = self._cell(r.cell, r.files)
            options, inputs = [*options, "--cell", cell], [*inputs, *found]
        return runs, options, inputs

    def _run_check(self, r: ask.RunCheckRequest) -> JobCommand:
        runs, options, inputs = self._measured_files(r, "check-plan")
        return JobCommand(("run-check", *options, *runs), tuple(inputs), task=True)

    def _identification(self, r: ask.IdentificationRequest) -> JobCommand:
        runs, options, inputs = self._measured_files(r)
        words = ["identify", *runs, *options, "-o", "out", JSON, "--seed", str(r.seed), "--hold-out", str(r.hold_out)]
        words += [
            f"--{w}" for w, on in (("no-trace", r.no_trace), ("geometry", r.geometry), ("robust", r.robust)) if on
        ]
        if r.validate_with:
            words, inputs = [*words, "--validate", r.validate_with.name], [*inputs, self._file(r.validate_with)]
        return JobCommand(tuple(words), tuple(inputs))

    def _error_map(self, r: ask.ErrorMapRequest) -> JobCommand:
        results = self._results(r.identification, "identification", "calibrated")
        table = [i for i in results if i.name in ("calibrated/expected_error.csv", "calibrated/identification.json")]
        if len(table) < 2:
            raise InputError(f"the identification {r.identification} has no expected errors")
        cell, inputs = self._cell_of_identification(r.identification)
        return JobCommand(("error-map", cell), (*table, *inputs), task=True)

    def _cell_of_identification(self, job: str) -> tuple[str, tuple[JobInput, ...]]:
        """The word for the cell that was identified in, and the files that lay there."""
        done = self._jobs.get(job).command
        return str(done.option("--cell")), done.inputs

    def _check_plan(self, r: ask.CheckPlanRequest) -> JobCommand:
        known = self._results(r.identification, "identification", "calibrated")
        cell, inputs = self._cell_of_identification(r.identification)
        words = ["plan-check", cell, "--baseline", "calibrated", "-o", "out", JSON, "--poses", str(r.poses)]
        words += ["--seed", str(r.seed), *(w for d in r.dialects for w in ("--dialect", d))]
        return JobCommand(tuple(words), (*inputs, *known))

    def _check(self, r: ask.CheckRequest) -> JobCommand:
        planned = self._results(r.check_plan, "check-plan", "check")
        known = self._jobs.get(r.check_plan).command.inputs_of("--baseline")
        words = ["check", r.run.name, "--plan", "check/plan.json", "--baseline", "calibrated", "-o", "out", JSON]
        words += [] if r.limit_mm is None else ["--limit-mm", str(r.limit_mm)]
        baseline = (JobInput(f"calibrated/{name}", sha256) for name, sha256 in known.items())
        return JobCommand(tuple(words), (self._file(r.run), *planned, *baseline))

    def _validation(self, r: ask.ValidationRequest) -> JobCommand:
        runs, options, inputs = self._measured_files(r)
        if len(runs) != 1:
            raise InputError(f"a validation is of one run, found {len(runs)}")
        words = ["accuracy", *runs, *options, "-o", "out", JSON]
        if r.model:
            inputs += self._results(r.model, "identification", "calibrated")
            words += ["--model", "calibrated/robot.toml"]
        return JobCommand(tuple(words), tuple(inputs))

    def _compensation(self, r: ask.CompensationRequest) -> JobCommand:
        inputs = [self._file(r.program), *self._results(r.model, "identification", "calibrated")]
        words = ["compensate", r.program.name, "--model", "calibrated/robot.toml", "-o", f"out/{r.program.name}"]
        words += _options(dialect=r.dialect, tool=r.tool, base=r.base) + (["--strict"] if r.strict else [])
        if r.frames:
            words, inputs = [*words, "--frames", r.frames.name], [*inputs, self._file(r.frames)]
        return JobCommand(tuple(words), tuple(inputs))

    def _cell(self, cell: str, files: Sequence[FileReference]) -> tuple[str, list[JobInput]]:
        """The word for a cell, and the files that it needs."""
        if "/" in cell:
            return cell, []
        return "cell.toml", [self._file(FileReference(id=cell, name="cell.toml")), *(self._file(f) for f in files)]

    def _file(self, file: FileReference | FileInFolder) -> JobInput:
        if not self._files.holds(file.id):
            raise InputError(f"'{file.name}': there is no file {file.id[:12]}…; upload it first")
        return JobInput(file.name, file.id)

    def _plan_files(self, job: str) -> list[JobInput]:
        return self._results(job, "plan", "plan", "check-plan")

    def _results(self, job: str, kind: str, folder: str, also: str = "") -> list[JobInput]:
        """The files of a finished job of a kind, or of one that does as well, that others need, in a folder."""
        try:
            found = self._jobs.get(job)
        except KeyError:
            raise UnknownJobError(f"there is no job {job}") from None
        if found.kind not in (kind, also):
            raise InputError(f"job {job} is a {found.kind}; a {kind} is needed")
        if found.state != "done":
            raise UnfinishedJobError(f"the {found.kind} {job} has no result yet: it is {found.state}")
        outputs = self._jobs.outputs(job)
        return [JobInput(f"{folder}/{o.name}", o.sha256) for o in outputs if not o.name.startswith(NOT_NEEDED)]


def job_id(request: JobRequest, command: JobCommand) -> str:
    """Return the identifier of a job: a hash of what it is asked for and of its files."""
    asked = json.loads(request.model_dump_json(exclude={"title"}))
    content = [request.kind, asked, [[i.name, i.sha256] for i in command.inputs]]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:24]


def _options(**values: object) -> list[str]:
    return [w for name, value in values.items() if value is not None for w in (f"--{name}", str(value))]
