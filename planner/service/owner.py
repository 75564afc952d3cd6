"""Names of the processes that run jobs: no two ever have the same, and whether one still runs can be told."""

import os
from pathlib import Path


def own_name() -> str:
    """Return the name of this process, which no other ever has."""
    return f"{_boot()}:{os.getpid()}:{_start_time(os.getpid())}"


def is_gone(owner: str) -> bool:
    """Tell whether the process of this name certainly runs no more; of another machine only its lease can tell."""
    boot, _, rest = owner.partition(":")
    pid, _, started = rest.partition(":")
    if boot != _boot() or not pid.isdigit():
        return False
    return _start_time(int(pid)) != started


def _boot() -> str:
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return "unknown"


def _start_time(pid: int) -> str:
    """Return when a process began, in ticks since the machine did; empty where there is none, or a dead one."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if words[0] in ("Z", "X") else words[19]
