"""Searches against naive versions of themselves, brute force, and their own certificates."""

import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest

import tests.design.observability.dh_arm as dh_arm
from planner.common.errors import InputError
from planner.design.observability.identifiability import find_identifiable
from planner.design.observability.information import INDEX_RULES, index_value
from planner.design.off_grid import refine_off_grid
from planner.design.selection.d_optimal import detmax
from planner.design.selection.index_criterion import (
    BarrierPotential,
    SwapTable,
    information_after,
)
from planner.design.selection.index_search import compute_index_curve, exchange_poses, find_knee
from planner.design.selection.matrix_forms import information_matrix
from planner.design.selection.pruning import PrunedPoses, prune_poses
from planner.design.selection.search import Swap
from tests.design.observability.dh_arm import NJ130
from tests.processors import with_threads

INDICES = list(INDEX_RULES)


def pool(seed, count=40, readings=1, size=4):
    return np.random.default_rng(seed).standard_normal((count, readings, size)) * np.array([1, 0.4, 2.0, 0.7])


@pytest.fixture(scope="module")
def arm_pool():
    q = dh_arm.shell_poses(NJ130, 1_500, seed=2)
    rows = dh_arm.rows(NJ130, q)
    kept = list(find_identifiable(rows, dh_arm.names(NJ130)).kept)
    return q, rows[..., kept], kept


def naive_prune(rows, n, kind):
    kept = list(range(len(rows)))
    while len(kept) > n:
        values = [index_value(kind, rows[kept[:k] + kept[k + 1 :]]) for k in range(len(kept))]
        kept.pop(int(np.argmax(values) if INDEX_RULES[kind].maximise else np.argmin(values)))
    return kept


@pytest.mark.parametrize("kind", INDICES)
@pytest.mark.parametrize(("seed", "readings"), [(0, 1), (1, 1), (2, 3)])
def test_pruning_is_the_naive_pruning(kind, seed, readings):
    rows = pool(seed, readings=readings)
    assert prune_poses(rows, 6, kind).tolist() == naive_prune(rows, 6, kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", INDICES)
def test_pruning_until_as_many_poses_as_parameters_has_every_number_on_its_way(kind):
    rows = pool(3, count=25)
    left = PrunedPoses.of(rows, kind, 20)
    assert left.sizes.tolist() == list(range(4, 21))
    for n, value in zip(left.sizes.tolist(), left.values, strict=True):
        assert left.choose(n).tolist() == naive_prune(rows, n, kind)
        assert value == pytest.approx(index_value(kind, rows[left.choose(n)]), rel=1e-12)


@pytest.mark.long
def test_pruning_of_the_arm_is_the_naive_pruning(arm_pool):
    rows = arm_pool[1][:120]
    assert prune_poses(rows, 30).tolist() == naive_prune(rows, 30, "O2")


@pytest.mark.long
def test_thinning_first_costs_little(arm_pool):
    rows = arm_pool[1]
    slow, fast = (index_value("O2", rows[prune_poses(rows, 60, exact_from=k)]) for k in (1_500, 300))
    assert fast < 1.1 * slow


@pytest.mark.parametrize(("seed", "readings", "n"), [(0, 1, 5), (1, 1, 6), (2, 3, 3), (3, 1, 4)])
def test_detmax_finds_the_best_determinant(seed, readings, n):
    rows = pool(seed, count=13, readings=readings)
    best = max(index_value("O1", rows[list(s)]) for s in combinations(range(13), n))
    chosen = detmax(rows, n, starts=4)
    assert len(set(chosen.tolist())) == n
    assert index_value("O1", rows[chosen]) == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("kind", INDICES)
@pytest.mark.parametrize(("seed", "readings", "n"), [(0, 1, 5), (1, 1, 6), (2, 3, 3)])
def test_exchange_finds_the_best_of_all_subsets(kind, seed, readings, n):
    rows = pool(seed, count=13, readings=readings)
    values = [index_value(kind, rows[list(s)]) for s in combinations(range(13), n)]
    best = max(values) if INDEX_RULES[kind].maximise else min(values)
    found = exchange_poses(rows, n, kind, starts=4, steps=400)
    assert len(set(found.chosen.tolist())) == n
    assert found.value == pytest.approx(index_value(kind, rows[found.chosen]), rel=1e-9)
    assert found.value == pytest.approx(best, rel=1e-3 if kind == "O5" else 1e-9)


@pytest.mark.parametrize("kind", ["O1", "O2", "O3", "O4"])
def test_scores_of_swaps_are_exact(kind):
    """Against eigenvalues of the changed matrices, for every pair."""
    rows, potential = pool(4, count=20), BarrierPotential(kind, 0.5)
    chosen = np.arange(7)
    table = SwapTable(rows[chosen], potential)
    shifts = potential.shifts(table.mu)
    pairs = [Swap(i, j) for i in range(7) for j in range(7, 20)]
    scores = table.of(rows[7:]).ravel()
    expected = potential.barrier(np.linalg.eigvalsh(information_after(rows, chosen, pairs)), *shifts)
    now = potential.barrier(np.linalg.eigvalsh(information_matrix(rows[chosen])), *shifts)
    inside = np.isfinite(expected)
    assert inside.sum() > 10
    assert scores[inside] == pytest.approx(expected[inside] - now, abs=1e-9)
    assert np.all(scores[~inside] < -10)


@pytest.mark.parametrize("kind", ["O2", "O3", "O4"])
def test_scores_after_exchanges_are_exact_at_the_same_barriers(kind):
    """Against eigenvalues, after two exchanges that the table was told of; its own trials are the same scores."""
    rows, potential = pool(4, count=40), BarrierPotential(kind, 0.5)
    table, chosen = SwapTable(rows[:12], potential), np.arange(12)
    shifts = potential.shifts(table.mu)
    for _ in range(2):
        out, into = np.unravel_index(np.argmax(table.of(rows[12:22])), (12, 10))
        table.exchange(out, rows[12 + into])
        chosen[out] = 12 + into
    now = potential.barrier(np.linalg.eigvalsh(information_matrix(rows[chosen])), *shifts)
    pairs = [Swap(i, j) for i in range(12) for j in range(22, 40)]
    expected = potential.barrier(np.linalg.eigvalsh(information_after(rows, chosen, pairs)), *shifts) - now
    inside = np.isfinite(expected)
    assert inside.sum() > 50
    assert table.of(rows[22:]).ravel()[inside] == pytest.approx(expected[inside], abs=1e-9)
    assert table.of_each(np.arange(12), np.tile(rows[22:], (12, 1, 1, 1))) == pytest.approx(
        table.of(rows[22:]), abs=1e-9
    )


@pytest.mark.parametrize("kind", ["O2", "O3", "O4"])
def test_the_shifts_are_the_best_ones(kind):
    mu, potential = np.array([0.3, 0.31, 0.9, 4.0, 7.0]), BarrierPotential(kind, 0.4)
    m, k = potential.weights(5)
    weight = {"O2": 1, "O3": 1, "O4": 2}[kind]

    def value(lower, upper):
        total = -weight * np.log(lower) - m * np.sum(np.log(mu / lower - 1))
        return total + (np.log(upper) - k * np.sum(np.log(1 - mu / upper)) if k else 0)

    lower, upper = potential.shifts(mu)
    best = value(lower, upper)
    for factor in (0.999, 1.001):
        assert value(lower * factor, upper) > best
        assert not k or value(lower, upper * factor) > best


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["O1", "O2", "O3"])
def test_no_swap_betters_the_result_and_it_beats_pruning(arm_pool, kind):
    rows = arm_pool[1][:400]
    found = exchange_poses(rows, 30, kind, starts=2, steps=600)
    pruned = index_value(kind, rows[prune_poses(rows, 30, kind)])
    assert INDEX_RULES[kind].is_better(found.value, pruned)
    assert found.gap >= 0
    mass, chosen = information_matrix(rows[found.chosen]), found.chosen
    for out in chosen[::6] if kind == "O1" else ():
        left = mass - information_matrix(rows[[out]])
        outside = np.setdiff1d(np.arange(400), chosen)
        mu = np.sqrt(np.linalg.eigvalsh(left + np.swapaxes(rows[outside], 1, 2) @ rows[outside])[:, ::-1].clip(0))
        assert np.max(INDEX_RULES[kind].of(mu, 30)) < found.value * (1 + 1e-9)


@pytest.mark.long
def test_the_gap_on_the_arm(arm_pool):
    rows = arm_pool[1]
    assert exchange_poses(rows, 35, "O2", starts=1, steps=3_000).gap < 0.16
    assert exchange_poses(rows, 100, "O2", starts=1, steps=1_000).gap < 0.04


@pytest.mark.slow
def test_refinement_keeps_every_filter_and_only_gets_better(arm_pool):
    q, rows, kept = arm_pool
    start = exchange_poses(rows, 30, "O2", starts=1, steps=200).chosen
    asked = []

    def valid(trial, _=None):
        reading = dh_arm.length(NJ130, trial)
        inside = (trial >= np.radians(NJ130.lower)) & (trial <= np.radians(NJ130.upper))
        asked.append(len(trial))
        return (reading > 0.3) & (reading < 0.52) & inside.all(axis=1) & (np.abs(trial[:, 4]) > 0.3)

    start = start[valid(q[start])]
    found = refine_off_grid(q[start], lambda t, _: dh_arm.rows(NJ130, t)[..., kept], valid, "O2", rounds=12)
    before, after = (index_value("O2", dh_arm.rows(NJ130, t)[..., kept]) for t in (q[start], found))
    assert after < 0.99 * before
    assert valid(found).all()
    assert (found != q[start]).any(axis=1).sum() > 5
    again = refine_off_grid(q[start], lambda t, _: dh_arm.rows(NJ130, t)[..., kept], valid, "O2", rounds=12)
    assert again.tobytes() == found.tobytes()
    with pytest.raises(InputError, match="does not pass the filters"):
        refine_off_grid(q[start] + 1.0, lambda t, _: dh_arm.rows(NJ130, t)[..., kept], valid)


@pytest.mark.slow
def test_the_curve_lies_on_the_right_side_of_its_bound(arm_pool):
    curve = compute_index_curve(arm_pool[1][:600], [24, 30, 40, 60, 90], steps=150)
    assert np.all(curve.values >= curve.bounds)
    assert curve.sizes.tolist() == [24, 30, 40, 60, 90]
    assert all(len(s.chosen) == n for s, n in zip(curve.selections, curve.sizes, strict=True))
    assert curve.knee in (30, 40, 60)


@pytest.mark.parametrize("kind", ["O2", "O3"])
def test_the_knee_of_a_broken_line_is_its_corner(kind):
    sizes = np.geomspace(20, 320, 9)
    log_value = np.where(sizes < 80, -1.0 * np.log(sizes / 80), -0.05 * np.log(sizes / 80))
    values = np.exp(log_value if kind == "O2" else -log_value)
    assert find_knee(sizes, values, kind) == pytest.approx(80, abs=1)
    noisy = values * (1 + 0.01 * np.where(np.arange(9) % 2, 1, -1))
    assert find_knee(sizes[::-1], noisy[::-1], kind) == pytest.approx(80, abs=1)
    with pytest.raises(InputError, match="three sizes"):
        find_knee([20, 30], [1.0, 2.0])


def test_too_few_poses_are_refused():
    rows = pool(0)
    for choose in (prune_poses, detmax, exchange_poses):
        with pytest.raises(InputError, match="4"):
            choose(rows, 3)


_SCRIPT = """
import hashlib, numpy as np
from planner.design.selection.d_optimal import detmax
from planner.design.selection.index_search import exchange_poses
from planner.design.selection.pruning import prune_poses
rows = np.random.default_rng(0).standard_normal((3000, 1, 12)) * np.linspace(0.2, 2, 12)
found = exchange_poses(rows, 20, "O2", starts=2, steps=150)
parts = [found.chosen, np.array(found.value), found.certificate.duals[0].X]
parts += [prune_poses(rows[:300], 20), detmax(rows, 20)]
print(hashlib.sha256(b"".join(p.tobytes() for p in parts)).hexdigest())
"""


@pytest.mark.slow
def test_the_same_bytes_on_one_thread_and_on_two():
    seen = {
        subprocess.run(
            [sys.executable, "-c", _SCRIPT],
            capture_output=True,
            text=True,
            check=True,
            **with_threads(threads),
        ).stdout
        for threads in "12"
    }
    assert len(seen) == 1
