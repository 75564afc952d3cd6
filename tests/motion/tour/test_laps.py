"""A tour of several laps: each goes through its own poses by the shortest way, from the mount pose back to it."""

from itertools import pairwise, permutations
from types import SimpleNamespace as Of

import numpy as np
import pytest

from planner.common.progress import UNLIMITED
from planner.motion.path.verdict import ProvenPath
from planner.session import tour_drive

lap_of = np.array([0, 1, 0, 1, 0, 1, 0, 1, 0])  # of the mount pose and eight others


@pytest.fixture
def join(monkeypatch):
    """A call of ``join_tour`` for poses whose legs cost what they are long in the plane."""
    at = np.random.default_rng(4).uniform(0.0, 10.0, (len(lap_of), 2))
    cost = np.linalg.norm(at[:, None] - at, axis=2)
    asked = []

    def connect(measuring, nodes, order, seed, pool):
        asked.append(order)
        return object.__new__(ProvenPath)

    monkeypatch.setattr(tour_drive, "tour_costs", lambda *_: cost)
    monkeypatch.setattr(tour_drive, "connect_poses", connect)

    def joined(lap, repeats):
        place = Of(cell=None, mounting=None, measuring=Of(limit=UNLIMITED), detours=None, repeats=repeats)
        tour, _ = tour_drive.join_tour(place, at, lap, "exact", 0)
        return tour, asked[-1], cost

    return joined


def shortest(poses, cost):
    return min(sum(cost[a, b] for a, b in pairwise([0, *way, 0])) for way in permutations(poses))


def test_each_lap_is_the_shortest_way_through_its_own_poses(join):
    tour, order, cost = join(lap_of, 0)
    ends = np.flatnonzero(np.array(order) == 0)
    assert len(ends) == 3
    total = 0.0
    for number, (a, b) in enumerate(pairwise(ends)):
        inner = order[a + 1 : b]
        assert sorted(inner) == np.flatnonzero((lap_of == number) & (np.arange(len(lap_of)) > 0)).tolist()
        driven = sum(cost[k, m] for k, m in pairwise(order[a : b + 1]))
        assert driven == pytest.approx(shortest(inner, cost), abs=1e-4)
        total += driven
    assert tour.cost_s == pytest.approx(total)
    assert tour.optimal
    assert sorted(tour.order.tolist()) == list(range(len(lap_of)))


def test_repeated_poses_come_last_and_one_lap_is_the_tour_itself(join):
    _, order, cost = join(np.zeros(len(lap_of), dtype=int), 2)
    ends = np.flatnonzero(np.array(order) == 0)
    assert len(ends) == 3
    first, again = order[1 : ends[1]], order[ends[1] + 1 : -1]
    assert sorted(first) == list(range(1, len(lap_of)))
    assert sum(cost[a, b] for a, b in pairwise([0, *first, 0])) == pytest.approx(shortest(first, cost), abs=1e-4)
    assert len(again) == 2
