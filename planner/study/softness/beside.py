"""Which loaded circles add most to what poses without load know: places for one fit of both."""

from collections.abc import Sequence

import numpy as np

from planner.cell import Cell
from planner.repeatable import first_best, single_threaded
from planner.study.softness.both import check_robots, one_tool
from planner.study.softness.circles import Candidate
from planner.study.softness.rows import Part, loaded_part, unloaded_part
from planner.units import Array

BETTER = 1e-9  # of the logarithm of a determinant: less is rounding


@single_threaded
def choose_beside(
    free_cell: Cell, q: Array, fixture: np.ndarray, cell: Cell, pool: Sequence[Candidate], count: int
) -> np.ndarray:
    """Return the positions in the pool, (count,), of the circles that one fit with the poses gains most from.

    The determinant of the information of geometry, compliances, tool point and zeros is what grows most: greedily, then
    by exchange as long as any swap gains (Fedorov 1972); what the poses say and the prior sizes stand beneath.

    Raises:
        InputError: the cells have different robots.
    """
    check_robots(free_cell, cell)
    first = unloaded_part(free_cell, q, fixture)
    parts = [loaded_part(cell, [c], one_tool(free_cell, cell)) for c in pool]
    names = (*first.names, *(n for n in parts[0].names if n not in first.names and not _own(n)))
    rows = first.on(names)
    return augmented(rows.T @ rows + np.eye(len(names)), np.array([_shared(p, names) for p in parts]), count)


def augmented(base: Array, blocks: Array, count: int) -> np.ndarray:
    """Return the ``count`` blocks (M, P, P) that together with ``base`` (P, P) have a large determinant, ascending."""
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(_best(base + blocks[chosen].sum(axis=0), blocks, chosen)[0])
    value = _size(base + blocks[chosen].sum(axis=0))
    improved = count > 0
    while improved:
        improved = False
        for k in range(count):
            rest = chosen[:k] + chosen[k + 1 :]
            other, gained = _best(base + blocks[rest].sum(axis=0), blocks, rest)
            if gained > value + BETTER:
                chosen[k], value, improved = other, gained, True
    return np.sort(np.array(chosen, dtype=int))


def _best(base: Array, blocks: Array, taken: Sequence[int]) -> tuple[int, float]:
    size = np.linalg.slogdet(base + blocks)[1]
    size[list(taken)] = -np.inf
    best = first_best(size)
    return int(best), float(size[best])


def _size(matrix: Array) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _own(name: str) -> bool:
    """Tell whether a parameter belongs to one place of the loaded bar alone."""
    return name.startswith("loaded fixture_")


def _shared(part: Part, names: Sequence[str]) -> Array:
    """Information of a circle about the parameters ``names`` (P, P) in prior sizes, its fixture left open."""
    own = [n for n in part.names if _own(n)]
    rows, open_ = part.on(names), part.on(own)
    across = open_.T @ rows
    return np.asarray(rows.T @ rows - across.T @ np.linalg.solve(open_.T @ open_ + np.eye(len(own)), across))
