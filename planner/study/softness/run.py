"""``places_study()``."""

from planner.cell import Cell
from planner.repeatable import single_threaded
from planner.study.softness.choice import Places, choose_places
from planner.study.softness.circles import candidates, driven


@single_threaded
def places_study(cell: Cell, most: int = 6, seed: int = 0) -> Places:
    """Find where up to ``most`` loaded circles tell the compliances of a cell's arm apart.

    Raises:
        InputError: the cell has no circle under load.
        NoSolutionError: no circle can be followed.
    """
    return choose_places(cell, candidates(cell, seed), driven(cell, seed), most, seed)
