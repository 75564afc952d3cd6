"""Sides from which poses at rest are come to, where the play of an axis is in question."""

import numpy as np

from planner.cell import Cell
from planner.run import Samples
from planner.separating.file import Identified


def sides_asked(identified: Identified, cell: Cell) -> tuple[int, ...]:
    """Axes whose side of approach a pose at rest must be come to from: those whose play is in question."""
    if cell.motion.measure != "static":
        return ()
    names = {n for f in identified.found if f.rivals for n in (f.name, *f.rivals)}
    return tuple(i for i in range(cell.robot.n_joints) if f"backlash, joint {i + 1}" in names)


def wanted_sides(samples: Samples, axes: tuple[int, ...]) -> np.ndarray:
    """Wanted signs (n, N) of the last movement of some axes, 0 for the others."""
    assert samples.direction is not None
    out = np.zeros(samples.q.shape, dtype=int)
    out[:, axes] = samples.direction[:, axes]
    out.setflags(write=False)
    return out
