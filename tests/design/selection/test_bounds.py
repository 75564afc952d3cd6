"""The certificate: below (or above) the best of all subsets, checked by brute force; and it cannot be faked."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import minimize

import tests.design.observability.dh_arm as dh_arm
from planner.common.errors import InputError
from planner.design.observability.identifiability import find_identifiable
from planner.design.observability.information import INDEX_RULES, index_value
from planner.design.selection.index_bound import IndexDual, certify_bound
from planner.design.selection.index_search import exchange_poses
from tests.design.observability.dh_arm import NJ130

INDICES = list(INDEX_RULES)


def pool(seed, count=14, readings=1, size=3):
    return np.random.default_rng(seed).standard_normal((count, readings, size)) * np.array([1, 0.3, 2.0])[:size]


def best_of_all(rows, n, kind):
    values = [index_value(kind, rows[list(s)]) for s in combinations(range(len(rows)), n)]
    return max(values) if INDEX_RULES[kind].maximise else min(values)


@pytest.fixture(scope="module")
def paper_pool():
    q = dh_arm.shell_poses(NJ130, 1_500, seed=1)
    rows = dh_arm.rows(NJ130, q)
    return rows[..., list(find_identifiable(rows, dh_arm.names(NJ130)).kept)]


@pytest.mark.parametrize("kind", INDICES)
@pytest.mark.parametrize(("seed", "readings", "n"), [(0, 1, 5), (1, 1, 4), (2, 3, 3), (3, 1, 9), (4, 3, 6)])
def test_no_subset_beats_the_bound(kind, seed, readings, n):
    rows = pool(seed, readings=readings)
    certificate, best = certify_bound(rows, kind, n), best_of_all(rows, n, kind)
    assert certificate.verified
    assert not INDEX_RULES[kind].is_better(best, certificate.value)
    # a bound that says something
    assert INDEX_RULES[kind].gap(best, certificate.value) < (0.9 if kind == "O4" else 0.5)


@pytest.mark.parametrize("kind", ["O1", "O2"])
def test_no_subset_of_any_size_beats_the_bound_for_any_number(kind):
    rows = pool(5, count=11)
    certificate = certify_bound(rows, kind)
    assert certificate.kind == "any number of poses"
    assert all(not INDEX_RULES[kind].is_better(best_of_all(rows, n, kind), certificate.value) for n in range(3, 12))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["O1", "O2", "O3", "O5"])
def test_the_bound_is_the_relaxation_to_a_tenth_of_a_percent(kind, paper_pool):
    certificate = certify_bound(paper_pool, kind, 60)
    assert certificate.verified
    assert certificate.relaxed == pytest.approx(certificate.value, rel=1e-3)
    active = paper_pool[certificate.support, 0]
    mass = (active * certificate.weights[:, None]).T @ active
    mu = np.sqrt(np.linalg.eigvalsh(mass)[::-1])
    assert float(INDEX_RULES[kind].of(mu, 60)) == pytest.approx(certificate.value, rel=2e-3)
    assert certificate.weights.sum() == pytest.approx(60)
    assert certificate.weights.max() < 1.001


@pytest.mark.long
def test_exactly_n_is_tighter_than_any_number(paper_pool):
    free = certify_bound(paper_pool, "O2").value
    assert free < certify_bound(paper_pool, "O2", 40).value < certify_bound(paper_pool, "O2", 120).value


@pytest.mark.long
def test_a_pool_of_the_paper_size_has_a_bound_near_thirty():
    """The rough trial on 4 460 such poses, with other joint limits, found 30.06; a general solver gave it."""
    rows = dh_arm.rows(NJ130, dh_arm.shell_poses(NJ130, 4_460))
    kept = list(find_identifiable(rows, dh_arm.names(NJ130)).kept)
    assert 29 < certify_bound(rows[..., kept], "O2").value < 32.5


@pytest.mark.slow
def test_any_number_agrees_with_a_general_solver():
    """The same relaxation for O2 on a small pool by direct search."""
    rows = pool(6, count=12)
    outer = np.einsum("nri,nrj->nij", rows, rows)

    def condition(w):
        mu = np.linalg.eigvalsh(np.tensordot(w, outer, 1))
        return np.sqrt(mu[-1] / max(mu[0], 1e-12))

    rng = np.random.default_rng(0)
    box = [(0, 1)] * 12
    tries = [
        minimize(condition, rng.random(12), bounds=box, method="Powell", options={"maxiter": 4000}).fun
        for _ in range(6)
    ]
    assert certify_bound(rows, "O2").value <= min(tries) * (1 + 1e-9)
    assert certify_bound(rows, "O2").value == pytest.approx(min(tries), rel=2e-2)


@pytest.mark.parametrize("kind", ["O1", "O2", "O3", "O5"])  # O4 is the quotient of two of them
def test_any_matrices_at_all_prove_nothing_wrong(kind):
    """Soundness does not rest on the solver: random duals never claim more than the truth."""
    rows, rng = pool(7), np.random.default_rng(1)
    best = best_of_all(rows, 5, kind)
    for _ in range(200):
        X, Y = (a @ a.T if rng.random() < 0.7 else a for a in rng.standard_normal((2, 3, 3)))
        assert not INDEX_RULES[kind].is_better(best, IndexDual(kind, 5, X, Y).verify(rows))


@pytest.mark.parametrize("kind", INDICES)
def test_a_corrupted_certificate_is_caught(kind):
    rows = pool(8)
    certificate = certify_bound(rows, kind, 6)
    sense = -1 if INDEX_RULES[kind].maximise else 1
    assert certificate.holds(rows)
    assert not replace(certificate, value=certificate.value * (1 + sense * 1e-6)).holds(rows)
    duals = [d for d in certificate.duals if isinstance(d, IndexDual)]
    assert len(duals) == len(certificate.duals)
    bent = [replace(d, X=d.X + 0.3 * np.diag(np.arange(3)) * np.trace(d.X)) for d in duals]
    assert not replace(certificate, duals=tuple(bent)).holds(rows)
    broken = [replace(d, X=d.X * np.nan) for d in duals]
    assert not replace(certificate, duals=tuple(broken)).holds(rows)
    better_pool = np.concatenate([rows, 10 * rows[:6], 10 * np.roll(rows[:6], 1, axis=2)])
    assert not certificate.holds(better_pool) or kind == "O2"


def test_the_only_set_is_its_own_certificate():
    rows = pool(9)
    certificate = certify_bound(rows, "O2", len(rows))
    assert certificate.value == index_value("O2", rows)
    assert certificate.holds(rows)
    assert exchange_poses(rows, len(rows), certificate=certificate).gap == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_a_bound_begun_near_another_is_as_good(paper_pool):
    far, near = (
        certify_bound(paper_pool, "O2", 50),
        certify_bound(paper_pool, "O2", 50, near=certify_bound(paper_pool, "O2", 35)),
    )
    assert near.value == pytest.approx(far.value, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["O2", "O3"])
def test_a_certificate_bounds_the_candidates_that_are_left(kind, paper_pool):
    whole = certify_bound(paper_pool, kind, 35)
    kept = np.random.default_rng(3).random(len(paper_pool)) < 0.7
    rest = whole.restrict_to_candidates(kept)
    assert rest.holds(paper_pool[kept])
    assert np.array_equal(paper_pool[kept][rest.support], paper_pool[whole.support[kept[whole.support]]])
    near = certify_bound(paper_pool[kept], kind, 40, near=rest)
    assert near.holds(paper_pool[kept])
    assert near.value == pytest.approx(certify_bound(paper_pool[kept], kind, 40).value, rel=1e-3)


def test_bad_input_is_refused():
    rows = pool(10)
    with pytest.raises(InputError, match="15 poses out of 14"):
        certify_bound(rows, "O2", 15)
    with pytest.raises(InputError, match="O3 grows"):
        certify_bound(rows, "O3")
    with pytest.raises(InputError, match="O9"):
        certify_bound(rows, "O9", 5)
    with pytest.raises(InputError, match="shape"):
        certify_bound(rows[:, 0], "O2", 5)


@pytest.mark.parametrize("kind", INDICES)
@pytest.mark.parametrize("spare", [0, 1, 2])
def test_hardly_more_candidates_than_poses(kind, spare):
    """All of the pool, or all but one or two: the cap leaves the weights next to no room, and none at all."""
    rows = pool(5, count=60 + spare)
    certificate = certify_bound(rows, kind, 60)
    assert certificate.verified
    values = [index_value(kind, np.delete(rows, out, axis=0)) for out in combinations(range(60 + spare), spare)]
    best = max(values) if INDEX_RULES[kind].maximise else min(values)
    assert (
        best <= certificate.value * (1 + 1e-9) if INDEX_RULES[kind].maximise else best >= certificate.value * (1 - 1e-9)
    )
    assert certificate.value == pytest.approx(best, rel=0.06)
