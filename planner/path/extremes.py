"""Smallest clearance and extreme bar lengths over motions, to within a stated tolerance (branch and bound)."""

from dataclasses import dataclass

import numpy as np

from planner.path.covering import Cells
from planner.path.proof import Prover
from planner.units import Array

LEVELS = 18  # of bisection at most


@dataclass(frozen=True)
class Extremes:
    """Over all motions together, each reached by some state and passed by none by more than the tolerance.

    Attributes:
        clearance: smallest distance of two bodies [m].
        length_min, length_max: of the bar [m].
    """

    clearance: float
    length_min: float
    length_max: float


def extremes(prover: Prover, corners: Array, tolerance: float) -> Extremes:
    """Search motions with corners (m, K, N) [rad] until none can hold a value beyond by ``tolerance`` [m]."""
    cells = Cells.of(corners)
    asked = np.ones((len(corners), len(prover.pairs.scene.pairs)), dtype=bool)
    nearest, shortest, longest = np.inf, np.inf, 0.0
    for _ in range(LEVELS):
        if len(cells.motion) == 0:
            break
        q, spokes = cells.q, cells.spokes
        pose, far = prover.workspace.travel(q, spokes)
        found = prover.distances.wanted(q, asked)
        nearest = min(nearest, float(found.min(initial=np.inf)))
        shortest, longest = min(shortest, float(pose.length.min())), max(longest, float(pose.length.max()))
        asked &= found - prover.pairs.changes(far) < nearest - tolerance
        shorter = pose.length - far.stretch < shortest - tolerance
        longer = pose.length + far.stretch > longest + tolerance
        if not prover.workspace.workspace.cell.gauge.is_bar:  # nothing whose length matters
            shorter, longer = np.zeros_like(shorter), np.zeros_like(longer)
        rows = np.flatnonzero(asked.any(axis=1) | shorter | longer)
        cells, asked = cells.take(rows).halves(), np.tile(asked[rows], (2, 1))
    return Extremes(nearest, shortest, longest)
