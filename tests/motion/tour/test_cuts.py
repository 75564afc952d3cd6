"""Inequalities of tours: kept by every tour, missed by points that are none."""

import itertools

import numpy as np

from planner.motion.tour.exact import DUAL_STEPS, Cut, Relaxation, violated_blossoms, violated_sets
from planner.motion.tour.instance import build_instance
from tests.motion.tour.conftest import brute_force, leg_costs

NODES = 6
PAIRS = np.column_stack(np.triu_indices(NODES, 1))


def prisms(size=NODES):
    """Two triangles of halves, joined by three whole legs: keeps all subtour inequalities, and is no tour."""
    x = np.zeros((size, size))
    for a, b in ((0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5)):
        x[a, b] = x[b, a] = 0.5
    for a in range(3):
        x[a, a + 3] = x[a + 3, a] = 1.0
    return x


def use_of(order):
    """Return how much of each pair a tour uses, (15,)."""
    x = np.zeros((NODES, NODES))
    x[order, np.roll(order, -1)] = x[np.roll(order, -1), order] = 1.0
    return x[tuple(PAIRS.T)]


def test_a_point_of_halves_misses_a_blossom_that_every_tour_keeps():
    x = prisms()
    assert violated_sets(x) == []
    cuts = violated_blossoms(x)
    assert len({c.key for c in cuts}) == 1  # both triangles are the same cut
    cut = cuts[0]
    assert cut.factors(PAIRS) @ x[tuple(PAIRS.T)] < cut.least - 0.5
    tours = [(0, *rest) for rest in itertools.permutations(range(1, NODES))]
    assert min(cut.factors(PAIRS) @ use_of(t) for t in tours) == cut.least


def test_a_subtour_is_missed_by_two_triangles_and_kept_by_tours():
    x = np.kron(np.eye(2), np.ones((3, 3)) - np.eye(3))
    cuts = [Cut.of(side) for side in violated_sets(x)]
    assert len({c.key for c in cuts}) == 1
    assert cuts[0].factors(PAIRS) @ x[tuple(PAIRS.T)] == 0.0
    assert min(cuts[0].factors(PAIRS) @ use_of((0, *r)) for r in itertools.permutations(range(1, NODES))) == 2.0


def test_the_relaxation_with_blossoms_bounds_every_tour_and_more_tightly(monkeypatch):
    gained = 0
    for seed in range(8):
        instance = build_instance(leg_costs(8, seed), [])
        legs = np.column_stack(np.triu_indices(8, 1))
        bounds = []
        for blossoms in (True, False):
            if not blossoms:
                monkeypatch.setattr("planner.motion.tour.exact.violated_blossoms", lambda x: [])
            relaxation = Relaxation(instance, int(instance.cost.sum()), legs)
            bounds.append(relaxation.bound(relaxation.optimize()))
            monkeypatch.undo()
        best = brute_force(instance.cost.astype(float))
        assert bounds[1] <= bounds[0] <= best * DUAL_STEPS
        gained += bounds[0] > bounds[1]
    assert gained > 0
