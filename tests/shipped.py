"""The shipped cells, each read once in a process: what a file of tests asks of all of them while it is collected."""

from functools import cache

from planner.cell.cell import Cell
from planner.cell.reading import load_cell, shipped_cells


@cache
def shipped_cell(name: str) -> Cell:
    """A cell by ``robot/cell``; nothing of it changes."""
    return load_cell(name)


def cells_that(holds) -> list[str]:
    """The names of the shipped cells of which a condition holds, sorted."""
    return [name for name in shipped_cells() if holds(shipped_cell(name))]
