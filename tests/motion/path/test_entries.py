"""The way to a later start: only proven legs, and the quickest of them."""

from itertools import pairwise

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.runs.run import FIRST_MOUNTING
from planner.session.resumption import entry_ways
from planner.session.tour_cost import leg_times


@pytest.mark.parametrize("seed", range(3))
def test_ways_use_the_path_and_its_shortcuts_only_and_none_is_quicker(seed):
    rng = np.random.default_rng(seed)
    cell = load_cell("kuka-kr6-r700/edbb")
    q = cell.home + rng.uniform(-0.3, 0.3, (9, 6))
    shortcuts = sorted(rng.choice(np.arange(2, 9), 2, replace=False).tolist())
    allowed = {frozenset((k, k + 1)) for k in range(8)} | {frozenset((0, k)) for k in shortcuts}
    seconds = {leg: leg_times(cell, FIRST_MOUNTING, *(q[[k]] for k in sorted(leg)))[0] + 1e-3 for leg in allowed}
    best = np.full(9, np.inf)
    best[0] = 0.0
    for _ in range(9):  # Bellman and Ford
        for leg, time in seconds.items():
            a, b = sorted(leg)
            best[b], best[a] = min(best[b], best[a] + time), min(best[a], best[b] + time)
    for point, way in enumerate(entry_ways(cell, FIRST_MOUNTING, q, shortcuts)):
        legs = [frozenset(pair) for pair in pairwise(way)]
        assert way[0] == 0
        assert way[-1] == point
        assert set(legs) <= allowed
        assert sum(seconds[leg] for leg in legs) == pytest.approx(best[point])
