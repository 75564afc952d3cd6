"""The process of one job: it dies with its server, keeps to its limits and its folder, and runs the command line.

Run as ``python -m planner.service.job_process`` in the folder of the job, which holds ``job.json``.
"""

import os
import runpy
import struct
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from ctypes import CDLL, c_char_p, c_int, c_long, c_size_t, c_uint32
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path

from pydantic import TypeAdapter

import planner
from planner.common.errors import PlannerError
from planner.common.files import INPUTS, data_folder
from planner.common.system import die_with, give_way, limit_process
from planner.service.file_store import copy_verified_file
from planner.service.job_record import JobCommand
from planner.service.settings import GB, JobLimits

DAMAGED = 66  # exit code: a file of the store is not what it was; the request is not to blame


class _Syscall(IntEnum):
    """Numbers of the system calls of Landlock, the same on every processor."""

    CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446


class _Right(IntFlag):
    """Rights of Landlock on files (linux/landlock.h) that are named here."""

    EXECUTE, WRITE, READ_FILE, READ_FOLDER, TRUNCATE = 1, 2, 4, 8, 1 << 14


_FILE_RIGHTS = _Right.EXECUTE | _Right.WRITE | _Right.READ_FILE | _Right.TRUNCATE
SYSTEM = ("/usr", "/bin", "/lib", "/lib32", "/lib64", "/etc", "/proc", "/sys/devices/system", "/nix", "/opt")


def confinement_version() -> int:
    """Return which version of Landlock this system has; 0 where it cannot confine a process."""
    if sys.platform != "linux":
        return 0
    libc = CDLL(None)
    libc.syscall.restype = c_long
    only_version = c_uint32(1)  # LANDLOCK_CREATE_RULESET_VERSION
    return max(0, int(libc.syscall(c_long(_Syscall.CREATE_RULESET), None, c_size_t(0), only_version)))


def confine_process(folder: Path, readable: Sequence[Path]) -> bool:
    """Confine this process and its children for good; return whether the kernel can.

    Args:
        folder: may be read and written.
        readable: may be read, beside the system's libraries and Python's.
    """
    no_new_privileges = 38  # PR_SET_NO_NEW_PRIVS of prctl
    version = confinement_version()
    if version < 1:
        return False
    libc = CDLL(None)
    libc.syscall.restype = c_long
    rights = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1}[min(version, 3)]  # all on files, by version
    all_network = 3  # to bind and to connect by TCP, from version 4
    rules = struct.pack("QQ", rights, all_network) if version >= 4 else struct.pack("Q", rights)
    ruleset = libc.syscall(c_long(_Syscall.CREATE_RULESET), c_char_p(rules), c_size_t(len(rules)), c_uint32(0))
    if ruleset < 0:
        return False
    look = _Right.EXECUTE | _Right.READ_FILE | _Right.READ_FOLDER
    libraries = {*SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix, *(p for p in sys.path if p)}
    for path in {*libraries, *map(str, readable)}:
        _allow(libc, ruleset, path, look & rights)
    for path in ("/dev/null", "/dev/urandom", "/dev/zero", "/dev/shm"):
        _allow(libc, ruleset, path, (_Right.READ_FILE | _Right.WRITE) & rights)
    _allow(libc, ruleset, str(folder), rights)
    libc.prctl(no_new_privileges, 1, 0, 0, 0)
    held: bool = libc.syscall(c_long(_Syscall.RESTRICT_SELF), c_int(ruleset), c_uint32(0)) == 0
    os.close(ruleset)
    return held


def _allow(libc: CDLL, ruleset: int, path: str, rights: int) -> None:
    if sys.platform != "linux":  # the kernel of no other system has Landlock
        return
    try:
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # this system has no such folder
        return
    if not os.path.isdir(path):
        rights &= _FILE_RIGHTS
    rule = struct.pack("=Qi", rights, handle)
    beneath = c_int(1)  # LANDLOCK_RULE_PATH_BENEATH
    libc.syscall(c_long(_Syscall.ADD_RULE), c_int(ruleset), beneath, c_char_p(rule), c_uint32(0))
    os.close(handle)


SPECIFICATION = "job.json"
INPUT_FOLDER = "work"
RESULTS = "out"  # folder in it for what the command writes
FIRST_TO_GO = "1000"  # the most that Linux knows


@dataclass(frozen=True)
class JobSpecification:
    """What a job's process is told: its server, the store of files, the command, and the limits."""

    parent: int
    files: str
    command: JobCommand
    limits: JobLimits


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
        raise SystemExit(DAMAGED) from err
    os.chdir(INPUT_FOLDER)
    here = Path.cwd()
    tempfile.tempdir = os.environ["TMPDIR"] = str(here.parent)
    INPUTS.confine((here.parent, data_folder("robots"), data_folder("g-code"), Path(planner.__file__).parent))
    confine_process(here.parent, [data_folder("robots"), data_folder("g-code"), Path(planner.__file__).parents[1]])
    sys.argv = ["edbb", *job.command.words]
    runpy.run_module(job.command.module, run_name="__main__", alter_sys=True)


def limit_resources(job: JobSpecification) -> None:
    """Set the limits that the operating system enforces; when memory runs out, it ends this process, not the server."""
    address_space_ratio = 4  # to the memory: libraries reserve more than they use; the server watches what is used
    most_written = 2 * GB  # bytes of a file that a command writes
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(FIRST_TO_GO, encoding="ascii")
    give_way(3 if job.command.task else 10)  # what answers a person goes first, then what a page waits for
    seconds = int(job.limits.time_s * (os.cpu_count() or 1)) + 1
    limit_process(address_space_ratio * job.limits.memory_bytes, most_written, seconds)


def lay_out(job: JobSpecification) -> None:
    """Copy the inputs out of the store, each checked by its hash.

    Raises:
        InputError: one has changed.
    """
    for item in job.command.inputs:
        target = Path(INPUT_FOLDER, item.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        copy_verified_file(Path(job.files, item.sha256[:2], item.sha256), item.sha256, target)


if __name__ == "__main__":
    main()
