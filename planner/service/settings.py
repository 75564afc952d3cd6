"""Where the service listens, where it keeps its files, and what a job may use."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from planner.common.errors import InputError

LOOPBACK = ("127.0.0.1", "::1", "localhost")
TOKEN_VARIABLE = "EDBB_TOKEN"
SHORTEST_TOKEN = 16
GB = 1 << 30


@dataclass(frozen=True)
class JobLimits:
    """What one job may use: resident memory [bytes] of its processes together, and time [s]."""

    memory_bytes: int = 4 * GB
    time_s: float = 7200.0


@dataclass(frozen=True)
class ServiceSettings:
    """All that the service is told.

    Attributes:
        folder: store of jobs and files.
        host, port: address to listen on.
        names: further names by which a browser may call this host.
        token: demanded of every caller where it is not empty; never printed.
        workers: most jobs at a time.
        limits: of each job.
        most_upload: bytes of one file.
        reserve: bytes that must stay free on the disk.
    """

    folder: Path
    host: str = "127.0.0.1"
    port: int = 8017
    names: tuple[str, ...] = ()
    token: str = field(default="", repr=False)
    workers: int = os.cpu_count() or 1
    limits: JobLimits = JobLimits()
    most_upload: int = GB
    reserve: int = GB // 4

    def __post_init__(self) -> None:
        if self.host not in LOOPBACK and not self.token:
            raise InputError(
                f"--host {self.host}: on an address that others reach a token is demanded; set the environment "
                f"variable {TOKEN_VARIABLE} to {SHORTEST_TOKEN} signs or more, or listen on 127.0.0.1"
            )
        if self.token and (len(self.token) < SHORTEST_TOKEN or not self.token.isascii()):
            raise InputError(
                f"{TOKEN_VARIABLE}: has {len(self.token)} signs; at least {SHORTEST_TOKEN}, all of ASCII, are needed"
            )


def default_folder() -> Path:
    """Return the folder of the store where none is named."""
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "edbb"


def default_memory(workers: int) -> int:
    """Return the memory [bytes] of one job where none is named: three quarters of the machine's, shared evenly."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(GB, int(0.75 * total) // workers)
