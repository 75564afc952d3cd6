"""Fig. 5 of the EDBB paper: the condition number over the number of poses as pruning takes one after the other away."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.design.selection.pruning import PrunedPoses

CANDIDATES = 3_400  # "approximately 3400 valid poses in the EDBB measurement space"
OPTIMUM = 35  # "an optimum number of poses is reached at approx. 35"
PARAMETERS = 22  # "reduced from 30 to 22 geometric model parameters": where the pruning ends


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_condition_number_has_its_optimum_near_35_poses(seed):
    cell = load_cell("comau-nj130/paper")
    rows = identify_candidates(cell, draw_candidates(cell, CANDIDATES, seed))[2]
    left = PrunedPoses.of(rows, "O2", 200)
    assert left.sizes[0] == PARAMETERS
    assert abs(left.knee - OPTIMUM) <= 6
    kappa = {n: np.linalg.cond(rows[left.choose(n), 0]) for n in (PARAMETERS, OPTIMUM, 100, 200, CANDIDATES)}
    lowest = min(left.values)
    assert kappa[OPTIMUM] < 1.08 * lowest  # from there on more poses bring little …
    assert kappa[PARAMETERS] > 1.35 * lowest  # … and with as many poses as parameters it has risen steeply
    assert max(kappa[100], kappa[200]) < 1.08 * lowest  # the paper keeps more for the trajectory: they cost nothing
    assert kappa[CANDIDATES] > 2 * lowest
