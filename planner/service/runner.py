"""Runs one job to its end: a process in a folder of its own, watched, and its files taken into the store."""

import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from planner.common.errors import FAILED, PARTLY_DONE, InputError
from planner.common.files import data_folder
from planner.common.system import group_memory, kill_group, start_in_own_group
from planner.service.command_words import hide_folders
from planner.service.file_store import FileStore
from planner.service.job_process import DAMAGED, INPUT_FOLDER, RESULTS, SPECIFICATION, SPECIFICATIONS, JobSpecification
from planner.service.job_record import JobOutput, JobProblem, JobRecord, State
from planner.service.job_store import LEASE_S, MOST_CRASHES
from planner.service.settings import GB, JobLimits


class ProcessGroup:
    """A process in a session of its own; what it prints goes into two files of its folder."""

    def __init__(self, module: str, folder: Path) -> None:
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("EDBB_TOKEN", "EDBB_WEBHOOK"))} | {
            "EDBB_PROGRESS": "json",
            "PYTHONUNBUFFERED": "1",
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "MPLCONFIGDIR": str(folder),
        }
        with (folder / "printed").open("wb") as printed, (folder / "log").open("wb") as log:
            self._process = start_in_own_group(
                [sys.executable, "-m", module],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=log,
                env=environment | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
            )
        self.id = self._process.pid

    def exit_code(self) -> int | None:
        """Return how it ended (negative: the signal that killed it), or nothing while it runs."""
        return self._process.poll()

    def kill(self) -> None:
        """Kill all of it, and wait until the first process is gone."""
        kill_group(self._process)
        self._process.wait()

    def memory(self) -> int:
        """Return the resident memory of all its processes [bytes]; 0 where the system does not tell."""
        return group_memory(self.id)


SHIPPED = re.compile(rf"{re.escape(str(data_folder('robots')))}/([\w-]+)/cells/([\w-]+)\.toml")  # cells, by path
MOST_LOG = 200_000  # bytes of what a command prints
TITLES = {
    1: "Internal error",
    2: "The input is wrong",
    3: "There is no solution",
    4: "A needed program is missing",
    DAMAGED: "A file of the store is damaged",
}
USAGE = re.compile(r"^╭─ Error ─+╮\n(.*?)^╰", re.MULTILINE | re.DOTALL)  # in which typer frames what is wrong
TRACEBACK = re.compile(r"^Traceback \(most recent call last\):", re.MULTILINE)
# as Python, numpy, C++, the loader, the C library and OpenBLAS say it
OUT_OF_MEMORY = re.compile(
    r"MemoryError|bad_alloc|failed to map segment|[Cc]annot allocate memory|Memory allocation still failed"
)


@dataclass(frozen=True)
class Ending:
    """How a process ended: by itself with a code, stopped because of a problem, or asked to by the server."""

    code: int | None = None
    problem: JobProblem | None = None
    cancelled: bool = False
    interrupted: bool = False


class RunningJobs(Protocol):
    """What a runner needs of the store of jobs."""

    def progress(self, job: JobRecord, stage: str, done: int, total: int) -> None:
        """Say how far a job is."""
        ...

    def renew(self, job: JobRecord) -> bool:
        """Go on to hold a job."""
        ...

    def wants_stop(self, job: JobRecord) -> bool:
        """Tell whether a job is to be stopped."""
        ...

    def finish(
        self, job: JobRecord, state: State, outputs: list[JobOutput], exit_code: int | None, problem: JobProblem | None
    ) -> bool:
        """End a job."""
        ...

    def requeue(self, job: JobRecord, crashed: bool) -> None:
        """Let a job wait again."""
        ...


class JobRunner:
    """Runs a job that this server has taken."""

    def __init__(self, job: JobRecord, jobs: RunningJobs, files: FileStore, folder: Path, limits: JobLimits) -> None:
        self._job, self._jobs, self._files, self._limits = job, jobs, files, limits
        self._folder = folder / f"{job.id}-{job.fence}"
        self.stop = threading.Event()

    def run(self) -> None:
        """Run the process and end the job by what came of it; the folder is removed whatever happens."""
        shutil.rmtree(self._folder, ignore_errors=True)
        (self._folder / INPUT_FOLDER / RESULTS).mkdir(parents=True)
        try:
            self._end(self._watch(self._start()))
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _start(self) -> ProcessGroup:
        job = JobSpecification(
            parent=os.getpid(), files=str(self._files.folder.resolve()), command=self._job.command, limits=self._limits
        )
        (self._folder / SPECIFICATION).write_bytes(SPECIFICATIONS.dump_json(job))
        return ProcessGroup("planner.service.job_process", self._folder)

    def _watch(self, process: ProcessGroup) -> Ending:
        """Wait for the process, pass its progress on, and stop it where it must not go on."""
        started = renewed = looked = time.monotonic()
        log = LogReader(self._folder / "log")
        try:
            while (code := process.exit_code()) is None:
                if self.stop.wait(0.1):  # [s] between two looks whether it is done
                    return Ending(interrupted=True)
                now = time.monotonic()
                for stage, done, total in log.progress():
                    self._jobs.progress(self._job, stage, done, total)
                if now - renewed > LEASE_S / 4:
                    renewed = now
                    self._jobs.renew(self._job)
                if self._jobs.wants_stop(self._job):
                    return Ending(cancelled=True)
                if now - started > self._limits.time_s:
                    return _overrun("time", f"it ran for more than {self._limits.time_s:g} s, all that a job may take")
                if now - looked > 1.0:  # [s] between two looks how much memory it takes
                    looked = now
                    if process.memory() > self._limits.memory_bytes:
                        most = self._limits.memory_bytes / GB
                        return _overrun("memory", f"it needed more than {most:.3g} GB, all that a job may use")
        finally:
            process.kill()
        return Ending(code)

    def _end(self, ending: Ending) -> None:
        job, jobs = self._job, self._jobs
        if ending.cancelled:
            jobs.finish(job, "cancelled", [], None, None)
        elif ending.interrupted:
            jobs.requeue(job, crashed=False)
        elif ending.problem is not None:
            jobs.finish(job, "failed", [], None, ending.problem)
        elif ending.code is not None and ending.code < 0:
            self._end_killed_job(-ending.code)
        else:
            self._end_with(ending.code or 0)

    def _end_killed_job(self, signal_number: int) -> None:
        if self._job.crashes + 1 < MOST_CRASHES:
            self._jobs.requeue(self._job, crashed=True)
            return
        detail = (
            f"its process was killed by signal {signal_number}, {MOST_CRASHES} times; the machine may be out of memory"
        )
        self._jobs.finish(self._job, "failed", [], None, JobProblem("The process was killed", detail))

    def _end_with(self, code: int) -> None:
        state: State = "done" if code in (0, PARTLY_DONE) or self._has_judged(code) else "failed"
        problem = None if state == "done" else self._problem(code)
        own_code = None if code == DAMAGED else code  # the command never ran
        with self._files.hold_files():
            self._jobs.finish(self._job, state, self._take_outputs(), own_code, problem)

    def _has_judged(self, code: int) -> bool:
        """Tell whether a command ended with 3 because what it judged has failed, not because of an error."""
        return code == FAILED and "edbb: " not in self._read_log()

    def _read_log(self) -> str:
        with (self._folder / "log").open("rb") as log:
            log.seek(max(0, (self._folder / "log").stat().st_size - MOST_LOG))
            return log.read().decode("utf-8", errors="replace")

    def _take_outputs(self) -> list[JobOutput]:
        """Move what the command wrote and printed into the store."""
        results = self._folder / INPUT_FOLDER / RESULTS
        out = [(p.relative_to(results).as_posix(), p) for p in sorted(results.rglob("*")) if _is_result(p)]
        printed = [(name, self._folder / name) for name in ("printed", "log")]
        printed = [(n, p) for n, p in printed if p.stat().st_size and n not in dict(out)]
        return [JobOutput(name, *self._files.take(path)) for name, path in (*out, *printed)]

    def _problem(self, code: int) -> JobProblem:
        own_code = None if code == DAMAGED else code
        return JobProblem(TITLES.get(code, f"Exit code {code}"), self._sentence(self._read_log(), code), own_code)

    def _sentence(self, log: str, code: int) -> str:
        """Return the last message of the command, without the folder of the job."""
        if OUT_OF_MEMORY.search(log[-500:]):
            return "the job needed more memory than a job may use"
        if code == InputError.exit_code and (framed := USAGE.search(log)):
            return " ".join(line.strip("│ ") for line in framed[1].splitlines())
        _, found, sentence = log.rpartition("edbb: ")
        if not found or TRACEBACK.search(log):
            last = log.strip().rpartition("\n")[2][:500]
            return f"a mistake of the program itself ended the command: {last or f'exit code {code}'}"
        here = self._folder.resolve() / INPUT_FOLDER
        sentence = SHIPPED.sub(r"\1/\2", sentence)
        return hide_folders(sentence.strip().replace(f"{here}/", "").replace(str(here), "the folder of the job"))


class LogReader:
    """Reads the lines of progress that a process adds to its log."""

    def __init__(self, path: Path) -> None:
        self._path, self._at, self._rest = path, 0, b""

    def progress(self) -> list[tuple[str, int, int]]:
        """Return the last stage that was told since the last call, and every stage that began before it."""
        with self._path.open("rb") as file:
            file.seek(self._at)
            new = file.read(MOST_LOG)
        self._at += len(new)
        *lines, self._rest = (self._rest + new).split(b"\n")
        found = [p for line in lines if (p := _read_progress(line)) is not None]
        return [p for k, p in enumerate(found) if k == len(found) - 1 or p[0] != found[k + 1][0]]


def _read_progress(line: bytes) -> tuple[str, int, int] | None:
    if not line.startswith(b'{"stage":'):
        return None
    try:
        said = json.loads(line)
        return str(said["stage"])[:80], int(said["done"]), int(said["of"])
    except (ValueError, KeyError, TypeError):
        return None


def _is_result(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _overrun(what: str, detail: str) -> Ending:
    return Ending(problem=JobProblem(f"Too much {what}", f"the job was stopped: {detail}"))
