"""Compliances from deflections, against a world that shares no code: over seeds, at their joint chi-square."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.loaded.compliance import (
    bar_deflection,
    compliance_combinations,
    fit_compliances,
    harmonic_counts,
    smooth_spectrum,
    turn_noise,
)
from planner.loaded.curves import average_curves

SEEDS, BINS, REPEATS = 24, 36, 5


@cache
def clean(errors=False):
    """A world without noise, with geometric errors or without, the setup with its ball in place, and the curves."""
    truth = world.World(errors=shared.ERRORS if errors else {}, white=0.0)
    way = world.course(shared.arm(), loads=(125.0, 375.0, 625.0), repeats=1, rate=150.0)
    _, length = world.readings(shared.arm(), truth, way, np.random.default_rng(0))
    run = shared.run_of(way, length)
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    thin = slice(None, None, len(curves.theta) // BINS)
    fields = {"theta": curves.theta[thin]}
    fields |= {name: getattr(curves, name)[:, :, thin] for name in ("q", "length", "force")}
    setup = replace(shared.setup(run), p_BX=(world.FIXTURE + truth.offset)[None])
    return truth, setup, replace(curves, **fields)


def noisy(curves, rng):
    """Repeats of every turn: white noise, and a smooth curve of its own in each."""
    D, K, B = curves.length.shape
    n = np.arange(6)
    wave = np.stack([np.cos(n[:, None] * curves.theta), np.sin(n[:, None] * curves.theta)])
    smooth = np.einsum("dkrcn,cnb->dkrb", rng.normal(0, 2e-6, (D, K, REPEATS, 2, 6)), wave)
    turns = curves.length[:, :, None] + smooth + rng.normal(0, 2e-6, (D, K, REPEATS, B))
    square = sum(turn_noise(turns[d, k]) for d in range(D) for k in range(K))
    noise = smooth_spectrum(square / (D * K * (REPEATS - 1)))
    return replace(curves, length=turns.mean(axis=2), noise=noise, repeats=np.full((D, K), REPEATS))


@pytest.mark.parametrize(("errors", "apart"), [(False, 5e-8), (True, 1.5e-6)])
def test_the_deflection_is_that_of_the_world(errors, apart):
    """Geometric errors of a milliradian change a deflection of a millimetre by a micrometre, no more."""
    truth, setup, curves = clean(errors)
    predicted = bar_deflection(setup, curves, truth.soft)
    predicted = predicted[:, 1:] - predicted[:, :1]
    assert np.abs(curves.deflection).max() > 5e-4
    assert np.abs(curves.deflection - predicted).max() < apart


@pytest.mark.long
def test_compliances_come_back_as_their_joint_chi_square_allows():
    truth, setup, curves = clean()
    total, misfit = [], []
    for seed in range(SEEDS):
        found = fit_compliances(setup, [noisy(curves, np.random.default_rng(seed))]).compliances
        off = found.pulled - found.information @ truth.soft
        total.append(float(off @ np.linalg.solve(found.information, off)))
        misfit.append(found.misfit)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 6 * SEEDS) / SEEDS
    assert low < np.mean(total) < 1.08 * high  # the noise is learnt from some 80 numbers a harmonic
    assert np.mean(misfit) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_negative_forces_push_and_tell_the_same():
    truth, way = world.World(), shared.course(repeats=1)
    pulled, _ = world.readings(shared.arm(), truth, way, np.random.default_rng(1))
    pushing = replace(way, force=-way.force)
    pushed, _ = world.readings(shared.arm(), truth, pushing, np.random.default_rng(1))
    values = []
    for course, length in ((way, pulled), (pushing, pushed)):
        run = shared.run_of(course, length)
        values.append(fit_compliances(shared.setup(run), average_curves(shared.setup(run), run, np.pi)).compliances)
    assert np.all(np.abs(values[0].value - values[1].value) < 3 * np.hypot(values[0].std, values[1].std) + 1e-9)


@pytest.mark.slow
def test_two_circles_know_more_than_one():
    truth, rng = world.World(wander=3e-6), np.random.default_rng(2)
    runs, rigs = [], []
    for away in (np.zeros(3), np.array([-0.1, 0.6, -0.3])):
        way = world.course(shared.arm(), repeats=2, centre=world.CENTRE + away)
        length, _ = world.readings(shared.arm(), truth, way, rng, world.FIXTURE + away)
        runs.append(shared.run_of(way, length))
        rigs.append(replace(shared.setup(runs[-1]), p_BX=(world.FIXTURE + away)[None]))
    curves = [average_curves(g, r, np.pi)[0] for g, r in zip(rigs, runs, strict=True)]
    second = replace(curves[1], circle=replace(curves[1].circle, place=1))
    both = replace(
        rigs[0], p_BX=np.stack([rigs[0].p_BX[0], rigs[1].p_BX[0]]), place_prior=np.repeat(rigs[0].place_prior, 2),
        place_names=("A", "B"),
    )  # fmt: skip
    alone = fit_compliances(rigs[0], curves[:1]).compliances
    together = fit_compliances(both, [curves[0], second]).compliances
    assert np.all(together.std < alone.std * 1.02)
    assert together.std.max() < 0.7 * alone.std.max()
    assert np.all(np.abs(together.value - truth.soft) < 4 * together.std)


def test_combinations_are_the_axes_of_the_information():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6)) * np.logspace(0, 3, 6)
    scaled = root.T @ root
    found = compliance_combinations(tuple(f"compliance{i + 1}" for i in range(6)), scaled)
    rebuilt = sum(np.outer(c.shares, c.shares) / c.std**2 for c in found)
    np.testing.assert_allclose(rebuilt, scaled, rtol=1e-8, atol=1e-9 * scaled.max())
    assert [c.std for c in found] == sorted(c.std for c in found)


@pytest.mark.parametrize("bins", [36, 37, 98])
def test_counts_make_parseval_hold(bins):
    y = np.random.default_rng(4).normal(size=bins)
    waves = np.fft.rfft(y, norm="ortho")
    assert (harmonic_counts(bins) * np.abs(waves) ** 2).sum() == pytest.approx((y**2).sum())
