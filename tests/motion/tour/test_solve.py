"""Tours against brute force, the two exact solvers against each other, and the promises of the certificate."""

import dataclasses

import numpy as np
import pytest

import planner.motion.tour.solve as solve
from planner.common.errors import InputError, NoSolutionError
from planner.motion.tour.solve import solve_tour
from planner.session.tour_drive import proof_nodes
from tests.motion.tour.conftest import brute_force, driven, leg_costs, slowest_axis_cost

UNPROVEN_AT_THE_ROOT = 11


def small_cases(count):
    """Random and lattice poses (many ties), with and without forbidden legs."""
    rng = np.random.default_rng(7)
    for trial in range(count):
        n = int(rng.integers(5, 8))
        q = rng.integers(0, 4, (n, 3)).astype(float) if trial % 2 else rng.uniform(0, 3, (n, 3))
        legs = rng.integers(0, n, (int(rng.integers(0, 2 * n)), 2)).tolist() if trial % 3 else []
        yield slowest_axis_cost(q, np.array([1.0, 2.0, 0.7])), [(a, b) for a, b in legs if a != b]


@pytest.mark.parametrize("few", [0, 12], ids=["branch and cut", "dynamic programming"])
def test_small_tours_are_those_of_brute_force(few, monkeypatch):
    monkeypatch.setattr(solve, "_FEW", few)
    solved = 0
    for cost, forbidden in small_cases(16):
        best = brute_force(cost, forbidden)
        if not np.isfinite(best):
            with pytest.raises(NoSolutionError, match="forbidden segments"):
                solve_tour(cost, forbidden=forbidden, method="exact")
            continue
        tour = solve_tour(cost, forbidden=forbidden, method="exact")
        solved += 1
        assert sorted(tour.order) == list(range(len(cost)))
        assert tour.order[0] == 0
        assert tour.optimal
        assert tour.cost_s == pytest.approx(best, abs=1e-5)
        assert tour.cost_s == pytest.approx(driven(cost, tour.order))
        assert tour.lower_bound_s <= best * (1 + 1e-12)
        legs = set(map(frozenset, zip(tour.order, np.roll(tour.order, -1), strict=True)))
        assert not legs & {frozenset(leg) for leg in forbidden}
    assert solved >= 8


def test_both_exact_solvers_agree_at_twelve_poses(monkeypatch):
    cost = leg_costs(12, seed=3)
    exact = solve_tour(cost)
    monkeypatch.setattr(solve, "_FEW", 0)
    embedded = solve_tour(cost, method="exact")
    assert (exact.solver, embedded.solver) == ("dynamic-programming", "embedded")
    assert embedded.cost_s == pytest.approx(exact.cost_s, abs=2e-5)


@pytest.mark.parametrize("clusters", [0, 6])
def test_a_hundred_poses_are_proven(clusters):
    cost = leg_costs(100, seed=5, clusters=clusters)
    tour = solve_tour(cost, method="exact")
    assert tour.optimal
    assert tour.solver == "embedded"
    assert 0.0 <= tour.cost_s - tour.lower_bound_s <= 1e-6 * 100
    assert tour.cost_s < tour.unsorted_s / 2
    assert tour.cost_s == pytest.approx(driven(cost, tour.order))


def test_the_order_repeats_and_is_read_only():
    cost = leg_costs(60, seed=1, clusters=4)
    one, two = (solve_tour(cost, method="exact") for _ in range(2))
    assert one.order.tolist() == two.order.tolist()
    assert one.order[0] == 0
    assert one.order[1] < one.order[-1]
    with pytest.raises(ValueError, match="read-only"):
        one.order[0] = 5
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.cost_s = 0.0


def test_forbidding_the_best_legs_costs_and_is_obeyed():
    cost = leg_costs(40, seed=2)
    free = solve_tour(cost, method="exact")
    banned = [(int(a), int(b)) for a, b in zip(free.order[3:9], free.order[4:10], strict=True)]
    bound = solve_tour(cost, forbidden=banned, method="exact")
    legs = set(map(frozenset, zip(bound.order, np.roll(bound.order, -1), strict=True)))
    assert not legs & {frozenset(leg) for leg in banned}
    assert bound.optimal
    assert bound.cost_s > free.cost_s


def test_a_pose_cut_off_from_all_others_is_no_solution():
    cost = leg_costs(20, seed=2)
    with pytest.raises(NoSolutionError, match="no order of the 20 poses exists that avoids the 18 forbidden segments"):
        solve_tour(cost, forbidden=[(7, other) for other in range(20) if other not in (7, 3)])


def test_a_search_cut_short_reports_bound_and_gap():
    cost = leg_costs(50, seed=UNPROVEN_AT_THE_ROOT)
    tour = solve_tour(cost, method="exact", nodes=0)
    best = solve_tour(cost, method="exact")
    assert not tour.optimal
    assert 0.0 < tour.cost_s / tour.lower_bound_s - 1.0 < 0.02
    assert tour.lower_bound_s <= best.cost_s <= tour.cost_s
    assert "not proven" in tour.notes[0]


def test_equal_poses_and_single_poses():
    assert solve_tour(np.zeros((30, 30))).cost_s == 0.0
    alone = solve_tour(np.zeros((1, 1)))
    assert (alone.order.tolist(), alone.cost_s) == ([0], 0.0)
    pair = solve_tour(np.array([[0.0, 2.0], [2.0, 0.0]]))
    assert (pair.order.tolist(), pair.cost_s) == ([0, 1], 4.0)


def test_costs_of_any_size_are_solved():
    small = leg_costs(30, seed=4)
    for factor in (1e-3, 1e4):
        tour = solve_tour(small * factor, method="exact")
        assert tour.optimal
        assert tour.cost_s / factor == pytest.approx(solve_tour(small).cost_s, rel=1e-4)


def test_a_method_that_there_is_not_is_named():
    with pytest.raises(InputError, match='found "quickly"'):
        solve_tour(np.ones((3, 3)), method="quickly")


def test_the_search_for_a_proof_is_shorter_the_more_poses_there_are():
    limits = [proof_nodes(n) for n in (40, 100, 200, 250, 400)]
    assert limits == sorted(limits, reverse=True)
    assert limits[0] == 100_000
    assert limits[1] > 20 * limits[2] > 0
    assert limits[-1] == 0
