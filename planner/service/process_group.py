"""A job's process with all its children: started, watched and killed together."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

PAGE = os.sysconf("SC_PAGE_SIZE")


class ProcessGroup:
    """A process in a session of its own; what it prints goes into two files of its folder."""

    def __init__(self, module: str, folder: Path) -> None:
        environment = {k: v for k, v in os.environ.items() if k != "EDBB_TOKEN"} | {
            "EDBB_PROGRESS": "json",
            "PYTHONUNBUFFERED": "1",
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "MPLCONFIGDIR": str(folder),
        }
        with (folder / "printed").open("wb") as printed, (folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=log,
                start_new_session=True,
                env=environment | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
            )
        self.id = self._process.pid

    def exit_code(self) -> int | None:
        """Return how it ended (negative: the signal that killed it), or nothing while it runs."""
        return self._process.poll()

    def kill(self) -> None:
        """Kill all of it, and wait until the first process is gone."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.id, signal.SIGKILL)
        self._process.wait()

    def memory(self) -> int:
        """Return the resident memory of all its processes [bytes]; 0 where the system does not tell."""
        total = 0
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                words = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            except OSError:
                continue
            if int(words[2]) == self.id:
                total += int(words[21]) * PAGE
        return total
