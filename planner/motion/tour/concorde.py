"""Concorde as a subprocess, where the user has it: TSPLIB file in, tour and certificate out.

Nothing that it says is believed unseen: the program is identified first, it works in a private folder and in a process
group of its own with a hard time-out, it is stopped at the line by which it says that it crashed (its signal handler
then sleeps for an hour), and its tour is accepted only if it is a permutation whose recomputed cost is the optimum that
it announces. Whether it is the shortest, the embedded solver decides.
"""

import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from planner.common.errors import PlannerError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.system import kill_group, start_in_own_group
from planner.common.units import IntArray
from planner.motion.tour.instance import TourInstance

TIMEOUT_S = 120.0  # [s] for one solve; 500 poses take it about 5 s
_CRASHED = b"FATAL ERROR - received signal"
_IDENTITY = "maximum chunk size in localcuts"  # in the usage text of the solver and of no other "concorde"


class ConcordeError(PlannerError):
    """Concorde is absent, is another program, failed, hung or wrote rubbish; the message says which."""


def find_concorde() -> Path | None:
    """Return the solver named by EDBB_CONCORDE or found on PATH, None if there is none.

    Raises:
        ConcordeError: EDBB_CONCORDE names no program, or what was found is not the Concorde TSP solver.

    """
    wanted = os.environ.get("EDBB_CONCORDE")
    found = shutil.which(wanted or "concorde")
    if found is None:
        if wanted:
            raise ConcordeError(f"EDBB_CONCORDE names {wanted}, which is not a program")
        return None
    with tempfile.TemporaryDirectory(prefix="edbb-") as folder:
        try:
            _, text = _run([os.path.abspath(found)], folder, 10.0)  # [s] to say what it is
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ConcordeError(f"{found} cannot be run: {error}") from error
    if _IDENTITY not in text:
        raise ConcordeError(f"{found} is not the Concorde TSP solver (the Python package of that name is another)")
    return Path(os.path.abspath(found))


def solve_concorde(
    program: Path, instance: TourInstance, upper: int, seed: int, limit: TimeLimit = UNLIMITED
) -> list[int]:
    """Return the closed tour over the instance's nodes that Concorde announces as the shortest.

    Args:
        program: what ``find_concorde`` returned.
        instance: the problem.
        upper: cost of a known tour without forbidden segments [units].
        seed: passed on.
        limit: of the time that a plan may take.

    Raises:
        ConcordeError: it crashed, hung, or wrote what is no tour, or one with a forbidden segment.

    """
    # a forbidden leg costs more than a tour that is known
    matrix = np.where(instance.forbidden, upper + 1, instance.cost)
    timeout = min(TIMEOUT_S, limit.remaining_seconds(LastStart.TOUR))
    with tempfile.TemporaryDirectory(prefix="edbb-") as folder:
        Path(folder, "problem.tsp").write_text(_tsplib(matrix), encoding="ascii")
        command = [str(program), "-s", str(seed), "-o", "out.sol", "problem.tsp"]
        try:
            code, text = _run(command, folder, timeout)
        except subprocess.TimeoutExpired as error:
            raise ConcordeError(f"Concorde did not finish in {timeout:.0f} s and was stopped") from error
        except OSError as error:
            raise ConcordeError(f"Concorde cannot be run: {error}") from error
        if _CRASHED.decode() in text:
            raise ConcordeError("Concorde crashed: it received a signal")
        tour = _read(Path(folder, "out.sol"), len(matrix))
    announced = re.search(r"Optimal Solution:\s*([0-9.eE+]+)", text)
    if tour is None or announced is None:
        raise ConcordeError(f"Concorde ended with code {code} and without an optimal tour")
    length = int(matrix[tour, np.roll(tour, -1)].sum())
    if abs(float(announced[1]) - length) > 0.5:
        raise ConcordeError(f"Concorde announced {announced[1]} for a tour that costs {length}")
    if instance.forbidden[tour, np.roll(tour, -1)].any():
        raise ConcordeError("Concorde's tour uses a forbidden segment")
    return tour


def _tsplib(matrix: IntArray) -> str:
    rows = "\n".join(" ".join(map(str, row)) for row in matrix.tolist())
    return (
        f"NAME: tour\nTYPE: TSP\nDIMENSION: {len(matrix)}\nEDGE_WEIGHT_TYPE: EXPLICIT\n"
        f"EDGE_WEIGHT_FORMAT: FULL_MATRIX\nEDGE_WEIGHT_SECTION\n{rows}\nEOF\n"
    )


def _read(file: Path, size: int) -> list[int] | None:
    """Return the permutation in a solution file (its length first), or None if there is none."""
    try:
        numbers = [int(word) for word in file.read_text(encoding="ascii").split()]
    except (OSError, ValueError):
        return None
    return numbers[1:] if numbers[:1] == [size] and sorted(numbers[1:]) == list(range(size)) else None


def _run(command: list[str], folder: str, timeout_s: float) -> tuple[int, str]:
    """Run in ``folder``, stop the whole process group at the end, return exit code and all that was printed.

    Raises:
        subprocess.TimeoutExpired: it neither ended nor crashed in ``timeout_s``.
    """
    with (
        open(os.path.join(folder, "printed.txt"), "w+b") as printed,
        start_in_own_group(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
        ) as process,
    ):
        try:
            code = _wait(process, Path(folder, "printed.txt"), timeout_s)
        finally:
            kill_group(process)
        printed.seek(0)
        return code, printed.read().decode("utf-8", "replace")


def _wait(process: "subprocess.Popen[bytes]", printed: Path, timeout_s: float) -> int:
    """Wait until the process ends, or prints that it crashed; return its exit code, or that of a crash."""
    until = time.monotonic() + timeout_s
    while True:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(0.02)  # [s] between two looks whether it is done
        if _CRASHED in printed.read_bytes():
            return -signal.SIGABRT
        if time.monotonic() > until:
            raise subprocess.TimeoutExpired(process.args, timeout_s)
