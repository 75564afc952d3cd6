"""What the operating system does for a process, on Linux, macOS and Windows: the one place where they differ.

Each function does its best on its system and says in its docstring what it cannot do there. What follows
``sys.platform`` in a branch of its own is checked for each of the three by mypy (``--platform``).
"""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import glob
from pathlib import Path
from typing import Any

from planner.common.lazy_modules import psutil


def expand_stars(words: list[str]) -> list[str]:
    """Return the words of a command line, the files in place of a word with * or ?; shells of Windows do not do it.

    Brackets stand for themselves: ``run[1].csv`` is what a browser calls its second ``run.csv``.
    """
    if sys.platform == "win32":
        found = {w: sorted(glob(w.replace("[", "[[]"))) for w in words if "*" in w or "?" in w}
        return [name for word in words for name in found.get(word) or [word]]
    else:
        return words


def start_in_own_group(command: list[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a program that :func:`kill_group` ends together with all that it has started."""
    if sys.platform == "win32":
        return subprocess.Popen(command, creationflags=subprocess.CREATE_NEW_PROCESS_GROUP, **options)
    else:
        return subprocess.Popen(command, start_new_session=True, **options)


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """End a program of :func:`start_in_own_group` and what it has started, at once.

    On Windows not what was started by a process that has ended.
    """
    if sys.platform == "win32":
        with suppress(psutil.NoSuchProcess):
            first = psutil.Process(process.pid)
            for each in (first, *first.children(recursive=True)):
                with suppress(psutil.Error):
                    each.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


def die_with(parent: int) -> None:
    """Let this process end when its parent does, however that happens: at once on Linux, else within a second."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # it died before it was asked for
            os.kill(os.getpid(), signal.SIGKILL)
    else:
        threading.Thread(target=end_with_parent, args=(parent,), daemon=True).start()


def end_with_parent(parent: int) -> None:
    """End this process once its parent is gone, however that ended."""
    if sys.platform == "win32":
        with suppress(psutil.NoSuchProcess):
            psutil.Process(parent).wait()
    else:
        while os.getppid() == parent:
            time.sleep(0.5)  # [s] between two looks
    os._exit(1)


def give_way(steps: int) -> None:
    """Let other processes go before this one: by so many steps of ``nice``, on Windows by one class."""
    if sys.platform == "win32":
        psutil.Process().nice(psutil.BELOW_NORMAL_PRIORITY_CLASS)
    else:
        os.nice(steps)


def limit_process(address_space: int, file_size: int, processor_s: int) -> None:
    """Limit this process: bytes that it reserves, bytes of a file, seconds of processor time; no core file.

    Windows has no such limits, and macOS does not keep that of the reserved bytes: who started the process watches it.
    """
    if sys.platform != "win32":
        import resource

        for what, most in (
            (resource.RLIMIT_AS, address_space),
            (resource.RLIMIT_FSIZE, file_size),
            (resource.RLIMIT_CPU, processor_s),
            (resource.RLIMIT_CORE, 0),
        ):
            try:
                resource.setrlimit(what, (most, most))
            except (ValueError, OSError):
                if sys.platform == "linux":
                    raise


@contextmanager
def hold_lock(path: Path) -> Iterator[None]:
    """Hold off every other process and thread that takes the same lock, at the file ``path``, meanwhile."""
    with path.open("a+b") as file:
        if sys.platform == "win32":
            import msvcrt

            file.seek(0)
            while True:
                with suppress(OSError):  # it gives up after ten seconds
                    msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
                    break
            try:
                yield
            finally:
                file.seek(0)
                msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
            yield


def swap_folders(a: Path, b: Path) -> bool:
    """Let two folders change places in one step; return whether this system and disk can."""
    here = -100  # AT_FDCWD: the folder that paths count from
    exchange = 2  # RENAME_EXCHANGE of renameat2
    if sys.platform == "win32":
        return False
    with suppress(AttributeError, OSError):
        libc = ctypes.CDLL(None, use_errno=True)
        names = os.fsencode(a), os.fsencode(b)
        if sys.platform == "darwin":
            return bool(libc.renamex_np(*names, 2) == 0)  # RENAME_SWAP of renamex_np
        return bool(libc.renameat2(here, names[0], here, names[1], exchange) == 0)
    return False


def is_open_elsewhere(err: OSError) -> bool:
    """Tell whether an operation failed as another program has the file open; only Windows says so.

    It says 5 (access denied) of a folder in which a file is open, 32 and 33 (sharing, lock) of the file itself.
    """
    return getattr(err, "winerror", None) in (5, 32, 33)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk; Windows does so by itself."""
    if sys.platform != "win32":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def give_back_memory() -> None:
    """Give memory that is free again back to the system: on Linux with glibc, other systems do so by themselves.

    Between what lives on, glibc keeps what was freed: after many large arrays came and went, as much again.
    """
    if sys.platform == "linux":
        with suppress(AttributeError):  # musl has no such function
            ctypes.CDLL(None).malloc_trim(0)


def keep_freed_memory() -> None:
    """Let large arrays take the place of others that were freed: on Linux with glibc, for this process from now on.

    Else each is mapped anew, and the system clears it page by page, which may take half as long as what is computed in
    it. :func:`give_back_memory` gives back what is free all the same.
    """
    if sys.platform == "linux":
        # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD: 16 MB, larger ones are few; 128 MB at the heap's end may be kept
        # M_ARENA_MAX: threads have one heap: each with its own would keep as much again, in pieces too small for most
        for option, value in ((-3, 16 << 20), (-1, 128 << 20), (-8, 1)):
            with suppress(AttributeError):  # musl has no such function
                ctypes.CDLL(None).mallopt(option, value)


def group_memory(group: int) -> int:
    """Return the resident memory of all processes of a group [bytes]; 0 on Windows, which has no such groups."""
    total = 0
    if sys.platform != "win32":
        for process in psutil.process_iter():
            with suppress(psutil.Error, OSError):
                total += process.memory_info().rss if os.getpgid(process.pid) == group else 0
    return total
