"""The order in which the poses are visited, with the proof of how good it is.

Concorde as a subprocess, where the user has it: TSPLIB file in, tour and certificate out.

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
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from planner.common.choices import TourSolver
from planner.common.errors import InputError, MissingProgramError, NoSolutionError, PlannerError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.system import kill_group, start_in_own_group
from planner.common.units import Array, IntArray
from planner.motion.tour.instance import TourInstance, build_instance

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
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=printed, stderr=subprocess.STDOUT
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


def shortest_order(cost_s: Array) -> tuple[list[int], float]:
    """Return the best closed order of all n nodes from node 0 on, and its cost [s]; infinite where there is none.

    ``cost_s`` is (n, n), forbidden legs infinite (Held and Karp, SIAM 10, 1962).
    """
    n = len(cost_s)
    best = np.full((2**n, n), np.inf)
    best[1, 0] = 0.0
    for visited in range(1, 2**n):
        if not np.isfinite(best[visited]).any():
            continue
        arrival = (best[visited][:, None] + cost_s).min(axis=0)
        for node in range(n):
            if not visited >> node & 1:
                best[visited | 1 << node, node] = arrival[node]
    visited, total = 2**n - 1, best[-1] + cost_s[:, 0]
    order = [int(total.argmin())]
    while len(order) < n:
        before = visited & ~(1 << order[-1])
        order.append(int((best[before] + cost_s[:, order[-1]]).argmin()))
        visited = before
    return order[::-1], float(total.min())


_TOOK_OVER = "the embedded solver took over"
_FEW = 12  # nodes up to which dynamic programming is quicker than everything else


@dataclass(frozen=True)
class Tour:
    """An order of visit and its certificate.

    Attributes:
        order: (n,) int, read-only: every node once from node 0 on; the last leg leads back to it. Of several laps the
            last leg of each does.
        unsorted_s: [s] cost of visiting in the order given.
        cost_s: [s] cost of this order.
        lower_bound_s: [s] proven: no order costs less.
        optimal: whether the proof is complete. It is made on costs rounded down to whole units (1 us, coarser
            only beyond 1000 s of legs), so that ``cost_s - lower_bound_s`` may still show that rounding, n units.
        solver: which found the order: "embedded", "dynamic-programming" or "concorde". The proof is never Concorde's.
        notes: what the person should know about how it was found.

    """

    order: IntArray
    unsorted_s: float
    cost_s: float
    lower_bound_s: float
    optimal: bool
    solver: str
    notes: tuple[str, ...] = ()


def solve_tour(
    cost_s: Array,
    *,
    forbidden: Collection[tuple[int, int]] = (),
    method: TourSolver = "auto",
    seed: int = 0,
    nodes: int = 100_000,
    limit: TimeLimit = UNLIMITED,
) -> Tour:
    """Find the cheapest closed tour of all nodes, and prove it.

    Args:
        cost_s: (n, n) symmetric leg costs [s], zero from a node to itself.
        forbidden: legs (a, b) that must not be used, in neither direction.
        method: "exact" is the embedded solver, "concorde" asks for Concorde too, "auto" where it is found.
        seed: of the local search and of Concorde.
        nodes: of the embedded solver's search tree at most; 0 proves what the root proves, which many poses take a
            minute less for. By default as many as a proof usually takes, and more.
        limit: of the time that a plan may take.

    Raises:
        InputError: there is no such method.
        NoSolutionError: no order avoids the forbidden legs.
        MissingProgramError: Concorde was asked for and is not there.

    """
    if method not in get_args(TourSolver):
        raise InputError(f'the tour is solved by "auto", "exact" or "concorde"; found "{method}"')
    request = _TourRequest(cost_s, frozenset(forbidden), method, seed, nodes, limit)
    return request.by_dynamic_programming() if len(cost_s) <= _FEW else request.by_search()


@dataclass(frozen=True)
class _TourRequest:
    """What was asked for."""

    cost_s: Array
    forbidden: frozenset[tuple[int, int]]
    method: TourSolver
    seed: int
    nodes: int
    limit: TimeLimit

    def by_dynamic_programming(self) -> Tour:
        """Solve by dynamic programming, on the costs as they are."""
        notes: tuple[str, ...] = ()
        if self.method == "concorde":
            require_concorde()
            notes = (f"Concorde was not needed: {_FEW} poses or fewer are solved by dynamic programming",)
        cost = self.cost_s.copy()
        for a, b in self.forbidden:
            cost[a, b] = cost[b, a] = np.inf
        order, total = shortest_order(cost)
        if not np.isfinite(total):
            raise self._no_order_error(proven=True)
        return self._tour(order, total, True, "dynamic-programming", notes)

    def by_search(self) -> Tour:
        """Solve by the embedded solver, from Concorde's tour on where that is wanted and possible."""
        from planner.motion.tour.exact import initial_search, solve_instance  # highspy is for plans alone

        instance = build_instance(self.cost_s, self.forbidden)
        search = initial_search(instance, self.seed, self.limit)
        announced, notes = self._ask_concorde(instance, instance.length(search.tour))
        if announced and instance.length(announced) < instance.length(search.tour):
            search.start_from(announced)
        cut = self.limit.must_stop(
            LastStart.TOUR, "of the proof that the tour is the shortest only the root was computed"
        )
        nodes = 0 if cut else self.nodes
        tour, bound = solve_instance(instance, search, nodes)
        length = instance.length(tour)
        if length >= instance.penalty:
            raise self._no_order_error(proven=bound >= instance.penalty)
        takes, least = length * instance.unit_s, bound * instance.unit_s
        if bound < length:
            notes += (
                f"the order of the poses is not proven the quickest: its segments take {takes:.1f} s, in any order "
                f"they take at least {least:.1f} s",
            )
        if announced and length < instance.length(announced):
            more = instance.length(announced) * instance.unit_s
            notes += (f"Concorde announced {more:.3f} s as the shortest, but {takes:.3f} s is possible; {_TOOK_OVER}",)
            announced = []
        return self._tour(announced or tour, least, bound >= length, "concorde" if announced else "embedded", notes)

    def _ask_concorde(self, instance: TourInstance, upper: int) -> tuple[list[int], tuple[str, ...]]:
        """Return the tour that Concorde announces as the shortest, or none, and what the person should know of that.

        None where it is not asked or failed. ``upper``: cost of a known tour [units].
        """
        if self.method == "exact":
            return [], ()
        try:
            program = require_concorde() if self.method == "concorde" else find_concorde()
            if program is None:
                return [], ()
            if upper >= instance.penalty:
                raise ConcordeError("Concorde was not asked, as no tour without forbidden segments was at hand")
            return solve_concorde(program, instance, upper, self.seed, self.limit), ()
        except ConcordeError as error:
            return [], (f"{error}; {_TOOK_OVER}",)

    def _tour(self, order: list[int], bound_s: float, optimal: bool, solver: str, notes: tuple[str, ...]) -> Tour:
        nodes = np.array(_canonical_direction(order), dtype=np.int64)
        nodes.setflags(write=False)
        cost = self._cost_of_order(nodes)
        return Tour(
            order=nodes,
            unsorted_s=self._cost_of_order(np.arange(len(nodes))),
            cost_s=cost,
            lower_bound_s=min(bound_s, cost),
            optimal=optimal,
            solver=solver,
            notes=notes,
        )

    def _cost_of_order(self, order: IntArray) -> float:
        return float(self.cost_s[order[:-1], order[1:]].sum() + self.cost_s[order[-1], order[0]])

    def _no_order_error(self, *, proven: bool) -> NoSolutionError:
        verdict = "exists" if proven else "was found"
        return NoSolutionError(
            f"no order of the {len(self.cost_s)} poses {verdict} that avoids the {len(self.forbidden)} forbidden "
            "segments; allow more room for detours, or leave out a pose that few others can reach"
        )


def _canonical_direction(order: list[int]) -> list[int]:
    """Return the one direction from node 0, of two that cost the same, that does not depend on how it was found."""
    place = order.index(0)
    order = order[place:] + order[:place]
    return [order[0], *order[:0:-1]] if len(order) > 2 and order[1] > order[-1] else order


def require_concorde() -> Path:
    """Return Concorde's program.

    Raises:
        MissingProgramError: it is not there.
    """
    try:
        program = find_concorde()
    except ConcordeError as error:
        raise MissingProgramError(f"Concorde was asked for, but {error}") from error
    if program is None:
        raise MissingProgramError(
            "Concorde was asked for, but there is no program of that name on PATH and EDBB_CONCORDE is not set. "
            'The method "exact" needs no other program'
        )
    return program
