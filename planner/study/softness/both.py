"""What a plan without load and some loaded circles would know in one fit of geometry and compliances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.observability import covariance
from planner.study.softness.circles import Candidate
from planner.study.softness.rows import loaded_part, unloaded_part
from planner.units import Array, frozen


@dataclass(frozen=True)
class Both:
    """Standard deviations per prior size, (P,) each, of geometry and compliances.

    ``unloaded``, ``loaded``: by one kind of run alone; ``both``: by one fit of all. ``prior`` sizes in ``units``.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    prior: Array
    unloaded: Array
    loaded: Array
    both: Array

    def of(self, start: str) -> tuple[tuple[str, float, float, float], ...]:
        """Rows (name, unloaded, loaded, both) of the parameters whose names begin so."""
        rows = zip(self.names, self.unloaded, self.loaded, self.both, strict=True)
        return tuple((n, float(u), float(w), float(b)) for n, u, w, b in rows if n.startswith(start))


def predicted_both(free_cell: Cell, q: Array, fixture: np.ndarray, cell: Cell, places: Sequence[Candidate]) -> Both:
    """Predict what unloaded poses and loaded circles know, each alone and together.

    Each gauge has its own fixtures and zero; the tool point is common where both cells have the same, geometry and
    compliances are.

    Args:
        free_cell: cell of the poses without load.
        q: controller angles of its poses, (n, N) [rad]; fixture: which holds the bar, (n,) int.
        cell: with the loaded circle; places: where it is driven.

    Raises:
        InputError: the cells have different robots.
    """
    check_robots(free_cell, cell)
    first = unloaded_part(free_cell, q, fixture)
    second = loaded_part(cell, places, one_tool(free_cell, cell))
    names = (*first.names, *(n for n in second.names if n not in first.names))
    common = [k for k, n in enumerate(names) if n in first.names and n in second.names]
    one, other = first.on(names), second.on(names)
    size = np.ones(len(names))
    known = [covariance(rows, 1.0, size).std for rows in (one, other, np.concatenate([one, other]))]
    where = [first.names.index(names[k]) for k in common]
    return Both(
        tuple(names[k] for k in common),
        tuple(first.units[k] for k in where),
        frozen(first.prior[where]),
        *(frozen(s[common]) for s in known),
    )


def check_robots(free_cell: Cell, cell: Cell) -> None:
    """Refuse two cells with different robots.

    Raises:
        InputError: with both names.
    """
    if free_cell.robot.name != cell.robot.name:
        raise InputError(
            f"{free_cell.path} has the robot {free_cell.robot.name}, but {cell.path} has {cell.robot.name}; one fit "
            "needs one robot"
        )


def one_tool(free_cell: Cell, cell: Cell) -> bool:
    """Tell whether both bars hang from the same ball of the same tool."""
    one, other = free_cell.tool, cell.tool
    same = np.allclose(one.p_FM, other.p_FM) and np.allclose(one.com_F, other.com_F)
    return bool(same and np.isclose(one.mass, other.mass))
