"""The folder of a job: files that a client has sent, and what earlier jobs have found, laid in for its command."""

import re
from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator, Field

from planner.common.errors import InputError
from planner.common.file_names import name_fault
from planner.common.schema import StrictModel
from planner.runs.run import SIMULATED
from planner.service.file_store import CellNotes, FileStore, UnknownFileError, UploadList
from planner.service.job_record import JobInput
from planner.service.job_store import JobStore

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$", description="identifier of an uploaded file")]
JobId = Annotated[str, Field(pattern="^[0-9a-f]{24}$", description="identifier of a job")]


def _check_parts(path: str) -> str:
    """Return a path all of whose names a file can have on every system.

    Raises:
        ValueError: with the name, and why.
    """
    for name in path.split("/"):
        if fault := name_fault(name):
            raise ValueError(f"'{name}' {fault}; take another name")
    return path


EverySystem = AfterValidator(_check_parts)
NAME = r"[A-Za-z0-9_]([A-Za-z0-9._+-]{0,98}[A-Za-z0-9_+-])?"  # Windows drops a dot at the end
FileName = Annotated[str, Field(pattern=f"^{NAME}$", examples=["run.csv"]), EverySystem]
FilePath = Annotated[str, Field(pattern=f"^({NAME}/){{0,4}}{NAME}$", examples=["a1/run.csv"]), EverySystem]
NOT_NEEDED = ("report.html", "residuals.csv", "printed", "log", "timings.json", "manifest.json")


class FileReference(StrictModel):
    """An uploaded file, and the name that it has in the folder of the job."""

    id: Sha256
    name: FileName


class FileInFolder(StrictModel):
    """An uploaded file, and where it lies in the folder of the job."""

    id: Sha256
    name: FilePath


class UnfinishedJobError(InputError):
    """A job that a request names has no result."""


class JobFolder:
    """Lays files into the folder of a job; every call returns the word by which the job's command names them."""

    def __init__(self, jobs: JobStore, files: FileStore, uploads: UploadList, cells: CellNotes | None = None) -> None:
        self.jobs, self._files, self._uploads, self._cells = jobs, files, uploads, cells
        self._inputs: list[JobInput] = []

    @property
    def inputs(self) -> tuple[JobInput, ...]:
        """All files that lie there.

        Raises:
            InputError: two of them have one name.
        """
        names = [i.name for i in self._inputs]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice:
            raise InputError(f"two files of the request are called '{twice}'; give them names of their own")
        return tuple(self._inputs)

    def file(self, file: FileReference | FileInFolder, under: str = "") -> str:
        """Copy an uploaded file into the folder, or into one ``under`` it; return its name there.

        Raises:
            UnknownFileError: it was never sent.
        """
        if not self._files.holds(file.id):
            raise UnknownFileError(f"'{file.name}': there is no file {file.id[:12]}…; upload it first")
        return self._lay(under + file.name, file.id)

    def cell(self, cell: str, files: Sequence[FileReference]) -> str:
        """Copy an uploaded cell and the files that it names; return its name. A shipped cell has its own name."""
        if "/" in cell:
            return cell
        word = self.file(FileReference(id=cell, name="cell.toml"))
        for file in files:
            self.file(file)
        return word

    def plan(self, job: str) -> str:
        """Copy the results of a finished plan, or of the plan of a check; return the path of ``plan.json``."""
        return f"{self.results(job, 'plan', 'plan', also='check-plan')}/plan.json"

    def results(self, job: str, kind: str, folder: str, also: str = "", only: tuple[str, ...] = ()) -> str:
        """Copy the results of a finished job that other jobs need into ``folder``, and return ``folder``.

        The job is of the given kind, or of the kind ``also``; with ``only``, no other files are copied.

        Raises:
            InputError: there is no such job, it is of another kind, or it has no result.
        """
        found = self.jobs.get(job)
        if found.kind not in (kind, also):
            raise InputError(f"job {job} is a {found.kind}; a {kind} is needed")
        if found.state != "done":
            raise UnfinishedJobError(f"the {found.kind} {job} has no result yet: it is {found.state}")
        for output in self.jobs.outputs(job):
            if not output.name.startswith(NOT_NEEDED) and (not only or output.name in only):
                self._lay(f"{folder}/{output.name}", output.sha256)
        return folder

    def cell_of(self, identification: str) -> str:
        """Copy all inputs of an identification; return the name of its cell."""
        done = self.jobs.get(identification).command
        self._inputs += done.inputs
        return str(done.option("--cell"))

    def baseline_of(self, check_plan: str) -> str:
        """Copy the calibration that a check was planned for; return the name of its folder."""
        for name, sha256 in self.jobs.get(check_plan).command.calibrated_inputs().items():
            self._lay(f"calibrated/{name}", sha256)
        return "calibrated"

    def simulated_robot_of(self, check_plan: str) -> str:
        """Copy the simulated run that the robot of a check was calibrated with; return its name.

        The comments of that run hold the true errors of the robot.

        Raises:
            InputError: the calibration was not simulated, or made elsewhere.
        """
        known = self.jobs.get(check_plan).command.calibrated_inputs().get("identification.json", "")
        made = self.jobs.writer(known, "identification")
        for run in made.command.inputs if made else ():
            if made and run.name in made.command.words and run.name.endswith(".csv"):
                with self._files.path(run.sha256).open("rb") as file:
                    if SIMULATED.encode() in file.read(65536):  # bytes of a run that its comments are sought in
                        return self._lay("robot.csv", run.sha256)
        raise InputError(
            "a check can be simulated only for a robot whose calibration was simulated, as only then its true errors "
            "are known. Drive the check and give its log"
        )

    def cell_title(self, cell: str) -> str:
        """Return the title of a cell."""
        sent = None if "/" in cell else self._uploads.find(cell)
        named = self._cells.find(cell).title if sent and self._cells else ""
        return named or (sent.name if sent else cell)

    def robot(self, cell: str) -> str:
        """Return the model of the robot of a cell; empty where an uploaded cell does not say it."""
        if "/" in cell:
            return cell.partition("/")[0]
        if not self._files.holds(cell):
            return ""
        most = 100_000  # bytes from the head of a cell in which its robot is looked for
        try:
            with self._files.path(cell).open("rb") as file:
                head = file.read(most)
        except OSError:
            return ""
        top = re.split(rb"(?m)^[ \t]*\[", head, maxsplit=1)[0]  # no more than a look: a job reads the file itself
        found = re.search(rb"(?m)^[ \t]*robot[ \t]*=[ \t]*(['\"])([^'\"\r\n]{1,200})\1", top)
        return found[2].decode("utf-8", errors="replace") if found else ""

    def place(self, job: str) -> str:
        """Return the cell or plan that a job was for, without the names of its runs."""
        return self.jobs.get(job).title.rpartition(" of ")[2]

    def _lay(self, name: str, sha256: str) -> str:
        self._inputs.append(JobInput(name, sha256))
        return name
