"""Where an artifact stands: as the cell has it, where the run found it near there, so that its errors count from there.

A run finds frames by itself, from any start; the base's six errors are then nearly zero, and what a person wants to
know, how far the base is from where the cell has it, is lost in the frame.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell import Cell
from planner.cell.placed import frame_of
from planner.rig import Rig
from planner.units import DEG, MM, Array

NEAR, TURNED = 20 * MM, 6 * DEG  # from the cell's place, as a robot by its data sheet finds it; beyond them, moved


def as_declared(cell: Cell, rig: Rig) -> Rig:
    """Return the rig with the one frame of an artifact or tracker where the cell has it, if it was found near there."""
    declared = _declared(cell, rig)
    if declared is None or not _near(*_apart(*declared, rig)):
        return rig
    R, p = declared
    return replace(rig, R_BG=R[None], p_BG=p[None])


def far_from_declared(cell: Cell, rig: Rig) -> list[str]:
    """Return what is to be told where the balls stand elsewhere than the cell says."""
    declared = _declared(cell, rig)
    if declared is None or cell.gauge.kind == "tracker":  # where a tracker stands is never known well
        return []
    off, turn = _apart(*declared, rig)
    if _near(off, turn):
        return []
    return [
        f"the run puts the balls {off / MM:.1f} mm and {turn / DEG:.2f} deg from where [artifact] of {cell.path.name} "
        "has them: was it moved, and are the units of the run right?"
    ]


def _declared(cell: Cell, rig: Rig) -> tuple[Array, Array] | None:
    """R (3, 3) and p (3,) [m] of the frame that the cell gives; ``None`` where there is not the one."""
    placed = cell.file.artifact if cell.gauge.kind in ("trical", "ball-socket") else cell.file.tracker
    return None if placed is None or rig.kind == "length" or len(rig.p_BG) > 1 else frame_of(placed)


def _near(off: float, turn: float) -> bool:
    return off <= NEAR and turn <= TURNED


def _apart(R: Array, p: Array, rig: Rig) -> tuple[float, float]:
    turn = Rotation.from_matrix(R.T @ rig.R_BG[0]).magnitude()
    return float(np.linalg.norm(rig.p_BG[0] - p)), float(turn)
