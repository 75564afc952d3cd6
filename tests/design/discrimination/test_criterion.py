"""Criterion, bound and exchange against finite differences, least squares and brute force."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from planner.design.assumptions import LOG_LIKELIHOOD_EVIDENCE
from planner.design.discrimination.power import discrimination_power
from planner.design.discrimination.search import (
    DiscriminationQuestion,
    PoolCoordinates,
    bound_criterion,
    dt_criterion,
    exchange_by_criterion,
    noncentrality,
)
from planner.design.pose_selection import warn_too_few_readings
from planner.design.selection.matrix_forms import information_matrix

OWN = np.arange(3)


def problem(count=14, readings=1, seed=0):
    """Rows of three own parameters, a finding of one and a rival of two, and the questions about them."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, readings, 6)) * np.array([1.0, 1e3, 1e-3, 1.0, 5.0, 1.0])
    rows[:, :, 4] += 4.0 * rows[:, :, 3]
    questions = (
        DiscriminationQuestion("a", np.array([3]), np.array([2.0]), OWN, np.array([4, 5])),
        DiscriminationQuestion("b", np.array([4, 5]), np.array([0.3, 0.1]), OWN, np.array([3])),
    )
    frame = PoolCoordinates.of(rows)
    return rows, frame, frame.rows(rows), questions, dt_criterion(frame, OWN, questions, np.ones(2))


def value(aim, rows):
    return aim.value(information_matrix(rows))


@pytest.mark.parametrize("readings", [1, 2])
def test_noncentrality_is_what_least_squares_leave(readings):
    rows, frame, seen, questions, _ = problem(readings=readings)
    chosen = [0, 2, 3, 5, 7, 8, 11, 13]
    for q in questions:
        tall = rows[chosen].reshape(-1, 6)
        left = np.linalg.lstsq(tall[:, q.alternatives], tall[:, q.shows] @ q.values, rcond=None)[1]
        assert noncentrality(frame, information_matrix(seen[chosen]), q)[0] == pytest.approx(float(left[0]), rel=1e-6)


def test_the_criterion_is_the_mean_of_logarithms_up_to_a_constant():
    rows, frame, seen, questions, aim = problem()
    sets = [np.arange(7), np.arange(7, 14), np.arange(3, 12)]
    by_hand = []
    for chosen in sets:
        mass = information_matrix(seen[chosen])
        own = np.linalg.slogdet(rows[chosen, 0, :3].T @ rows[chosen, 0, :3])[1]
        by_hand.append(0.375 * sum(np.log(noncentrality(frame, mass, q)[0]) for q in questions) + 0.25 / 3 * own)
    values = [value(aim, seen[chosen]) for chosen in sets]
    assert np.diff(values) == pytest.approx(np.diff(by_hand), abs=1e-5)


def test_slope_is_the_derivative():
    _, _, seen, _, aim = problem()
    mass, rng = information_matrix(seen[:9]), np.random.default_rng(1)
    way = rng.standard_normal(mass.shape)
    way = (way + way.T) * 1e-6
    expected = (aim.value(mass + way) - aim.value(mass - way)) / 2
    assert np.sum(aim.slope(mass) * way) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("readings", [1, 2])
def test_changes_are_exact(readings):
    _, _, seen, _, aim = problem(readings=readings)
    inner, outer = seen[:8], seen[8:]
    table = aim.swap_gains(inner, outer, information_matrix(inner))
    for i, j in ((0, 0), (3, 4), (7, 5)):
        swapped = np.concatenate([np.delete(inner, i, axis=0), outer[j : j + 1]])
        assert table[i, j] == pytest.approx(value(aim, swapped) - value(aim, inner), abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_no_set_of_all_beats_the_bound_and_the_exchange_finds_the_best(seed):
    _, _, seen, _, aim = problem(seed=seed)
    values = {s: value(aim, seen[list(s)]) for s in combinations(range(14), 8)}
    found = bound_criterion(seen, aim, 8, np.arange(8))
    chosen = exchange_by_criterion(seen, aim, found, np.arange(8), 0, np.arange(14))
    best = max(values.values())
    assert best <= found.value
    assert found.value - best < 0.35
    assert found.holds(seen)
    assert value(aim, seen[chosen]) == pytest.approx(best, abs=1e-6)


def test_a_bound_that_promises_too_little_is_refused():
    _, _, seen, _, aim = problem()
    found = bound_criterion(seen, aim, 8, np.arange(8))
    assert not replace(found, value=found.value - 0.01).holds(seen)


def test_as_many_readings_are_asked_for_as_the_identification_wants():
    assert warn_too_few_readings(60, 40) is None
    assert "--poses" in warn_too_few_readings(59, 40)


def test_power_is_the_share_of_simulated_runs():
    """Twenty readings, a truth of known shape, a rival of another: how often is the truth a hundred to one likelier?"""
    rng = np.random.default_rng(3)
    one, two = np.linalg.qr(rng.standard_normal((20, 2)))[0].T
    two = 0.9 * one + np.sqrt(1 - 0.81) * two
    size = 9.0
    runs = size * one + rng.standard_normal((4000, 20))
    gain = (runs @ one) ** 2 - (runs @ two) ** 2
    left = size**2 * (1 - 0.81)
    assert np.mean(gain > LOG_LIKELIHOOD_EVIDENCE) == pytest.approx(discrimination_power(left, size**2), abs=0.06)
