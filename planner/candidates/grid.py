"""The EDBB paper's own way (section 2.1.3): an equidistant grid over joint space, most of it outside the shell."""

from collections.abc import Iterator

import numpy as np

from planner.candidates.shell import ShellSample, box
from planner.cell import Cell
from planner.errors import InputError
from planner.units import Array

BLOCK = 1 << 18
LARGEST = 200_000_000


def grid_blocks(cell: Cell, step: float) -> Iterator[ShellSample]:
    """Yield the states of the equidistant joint grid with ``step`` [rad], centred in each joint's range, in blocks.

    Raises:
        InputError: the grid has more states than can be visited.
    """
    lower, upper = box(cell)
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int) + 1, 1)
    total = int(np.prod(counts.astype(object)))
    if total > LARGEST:
        raise InputError(
            f"plan.grid_step_deg = {np.rad2deg(step):g} gives {total:.3g} joint states; at most {LARGEST:.3g} can be "
            "visited: take a wider step"
        )
    origin = (lower + upper) / 2 - (counts - 1) * step / 2
    for start in range(0, total, BLOCK):
        index = np.unravel_index(np.arange(start, min(start + BLOCK, total)), tuple(counts))
        q: Array = origin + np.stack(index, axis=1) * step
        yield ShellSample(q, len(q))
