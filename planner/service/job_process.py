"""The process of one job: it dies with its server, keeps to its limits and its folder, and runs the command line.

Run as ``python -m planner.service.job_process`` in the folder of the job, which holds ``job.json``.
"""

import os
import resource
import runpy
import signal
import sys
import tempfile
from ctypes import CDLL
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

import planner
from planner.common.errors import PlannerError
from planner.common.files import data_folder
from planner.common.reading import INPUTS
from planner.service.file_store import copy_checked
from planner.service.job_store import JobCommand
from planner.service.sandbox import confine_process

SPECIFICATION = "job.json"
INPUT_FOLDER = "work"
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG
NICE = 10  # what answers a person goes first
ADDRESS_SPACE = 4  # times the memory: libraries reserve more than they use; the server watches what is used


@dataclass(frozen=True)
class JobSpecification:
    """What a job's process is told: its server, the store of files, the command, and the limits."""

    parent: int
    files: str
    command: JobCommand
    memory_bytes: int
    time_s: float
    file_bytes: int


SPECIFICATIONS = TypeAdapter(JobSpecification)


def main() -> None:
    """Lay out the inputs, close the doors, and run the command; the exit code is the command's."""
    job = SPECIFICATIONS.validate_json(Path(SPECIFICATION).read_bytes())
    die_with(job.parent)
    limit_resources(job)
    try:
        lay_out(job)
    except PlannerError as err:
        sys.stderr.write(f"edbb: {err}\n")
        raise SystemExit(err.exit_code) from err
    os.chdir(INPUT_FOLDER)
    here = Path.cwd()
    tempfile.tempdir = os.environ["TMPDIR"] = str(here.parent)
    INPUTS.confine((here.parent, data_folder("robots"), data_folder("g-code"), Path(planner.__file__).parent))
    confine_process(here.parent, [data_folder("robots"), data_folder("g-code"), Path(planner.__file__).parents[1]])
    sys.argv = ["edbb", *job.command.words]
    runpy.run_module(
        "planner.service.tasks" if job.command.task else "planner.cli", run_name="__main__", alter_sys=True
    )


def die_with(parent: int) -> None:
    """Let the system kill this process when its server dies, however that happens."""
    if sys.platform == "linux":
        CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:  # it died before it was asked for
        os.kill(os.getpid(), signal.SIGKILL)


def limit_resources(job: JobSpecification) -> None:
    """Set the limits that the system itself keeps."""
    os.nice(NICE)
    seconds = int(job.time_s * (os.cpu_count() or 1)) + 1
    for what, most in (
        (resource.RLIMIT_AS, ADDRESS_SPACE * job.memory_bytes),
        (resource.RLIMIT_FSIZE, job.file_bytes),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(what, (most, most))


def lay_out(job: JobSpecification) -> None:
    """Copy the inputs out of the store, each checked by its hash.

    Raises:
        InputError: one has changed.
    """
    for item in job.command.inputs:
        target = Path(INPUT_FOLDER, item.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        copy_checked(Path(job.files, item.sha256[:2], item.sha256), item.sha256, target)


if __name__ == "__main__":
    main()
