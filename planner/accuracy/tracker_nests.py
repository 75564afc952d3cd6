"""Nests as a tracker reads them: all that shows its own scale, which no pose tells from the lengths of the arm."""

import numpy as np

from planner.accuracy.assumptions import FRAMES
from planner.cell.cell import Cell
from planner.common.units import to_mm
from planner.runs.run import ReferenceReadings


def compare_nest_distances(cell: Cell, said: ReferenceReadings) -> str:
    """Say by how much the distances of the nests were read longer than the cell has them; empty where they agree.

    Args:
        cell: its nests have their places, and some of them what was read there.
        said: what stands above the columns of a run; it comes before what the cell has.
    """
    now = dict(said.nests)
    read = [(n.name, n.p_WN, now.get(n.name, n.p_GN)) for n in cell.nests if n.name in now or n.p_GN is not None]
    if len(read) < 2:
        return ""
    first, second = np.triu_indices(len(read), 1)
    W, G = np.array([p_WN for _, p_WN, _ in read]), np.array([p_GN for _, _, p_GN in read])
    true, seen = (np.linalg.norm(p[first] - p[second], axis=1) for p in (W, G))
    longer = float(true @ seen / max(true @ true, 1e-12)) - 1.0
    k = int(true.argmax())
    if abs(longer) * true[k] <= FRAMES.nest_tolerance:
        return ""
    more = "longer" if longer > 0 else "shorter"
    return (
        f"the tracker read the distances of the nests {abs(longer) * 100:.2g} % {more} "
        f"than {cell.path.name} has them ({read[first[k]][0]} to {read[second[k]][0]}: {float(to_mm(seen[k])):.3f} mm, "
        f"position_mm says {float(to_mm(true[k])):.3f}): the calibrated robot is off by as much, and no pose shows it. "
        "Check the tracker's temperature, pressure and unit on a scale bar, or measure the nests again"
    )
