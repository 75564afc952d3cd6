"""The centre's offset: linear, and in the paper's form without being led astray by a first guess."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.loaded.compliance import centring_offset
from planner.reproduction.loaded_bar import fit_sine

THETA = (np.arange(360) + 0.5) * 2 * np.pi / 360
PUBLISHED = (0.764e-3, 0.933, np.radians(14.08))


def paper(theta, a, b, phi):
    return a * np.sin(b * theta - phi)


def test_the_papers_numbers_come_back():
    y = paper(THETA, *PUBLISHED) + 2e-5 * np.cos(3 * THETA)
    found = fit_sine(THETA, y)
    known, _ = curve_fit(paper, THETA, y, p0=(0.8e-3, 1.0, np.radians(22.5)), xtol=1e-14, ftol=1e-14)
    assert found[:3] == pytest.approx(tuple(known), rel=1e-4)
    assert found[0] == pytest.approx(PUBLISHED[0], rel=0.02)


@pytest.mark.slow
def test_bad_guesses_lead_the_papers_form_astray_but_not_ours():
    rng = np.random.default_rng(1)
    astray = 0
    for _ in range(20):
        truth = (rng.uniform(0.2, 2.0) * 1e-3, rng.uniform(0.85, 1.15), rng.uniform(-np.pi, np.pi))
        y = paper(THETA, *truth) + 2e-5 * np.cos(3 * THETA + 1) + rng.normal(0, 2e-6, 360)
        amplitude, _, _, least = fit_sine(THETA, y)
        assert least < 1.02 * np.std(y - paper(THETA, *truth)) + 1e-9
        assert amplitude == pytest.approx(truth[0], rel=0.15)
        guess = (rng.uniform(0, 5) * 1e-3, rng.uniform(0.3, 2.8), rng.uniform(-np.pi, np.pi))
        led, _ = curve_fit(paper, THETA, y, p0=guess, maxfev=20_000)
        rms = np.sqrt(np.mean((y - paper(THETA, *led)) ** 2))
        assert least <= rms * (1 + 1e-6)
        astray += rms > 2 * least
    assert astray > 3  # the paper's warning: it is no idle one


@pytest.mark.parametrize("phase", [-2.0, 0.0, 1.0, 3.0])
def test_with_b_fixed_it_is_the_first_harmonic(phase):
    y = 3e-4 * np.sin(THETA - phase) + 1e-4 * np.sin(2 * THETA + 0.3) + 5e-5 * np.cos(5 * THETA)
    found = centring_offset(THETA, y)
    wave = np.fft.rfft(y)[1] / 180 * np.exp(-1j * THETA[0])  # grid begins half a step in
    assert found.amplitude == pytest.approx(abs(wave), rel=1e-9)
    assert found.amplitude == pytest.approx(3e-4, rel=1e-9)
    assert np.exp(1j * found.phase) == pytest.approx(np.exp(1j * phase), abs=1e-9)


@pytest.mark.slow
def test_a_ball_off_its_place_is_found():
    truth = world.World(soft=np.full(6, 1e-9), offset=np.array([-6e-4, 2e-4, 0.0]), zero=0.0, white=1e-9)
    way = shared.course(loads=(100.0, 600.0), repeats=1)
    length, _ = world.readings(shared.arm(), truth, way, np.random.default_rng(0))
    from planner.loaded.evaluation import evaluate_loaded_circles

    (circle,) = evaluate_loaded_circles(shared.run_of(way, length), shared.cell()).circles
    np.testing.assert_allclose(circle.centre_offset, [6e-4, -2e-4], atol=4e-6)


@pytest.mark.slow
def test_offset_and_kinematic_error_are_those_of_the_unloaded_arm():
    """First harmonic and rest of the bar's length on the true arm without load, by another road."""
    truth, way, found = shared.evaluated()
    (circle,) = found.circles
    theta = circle.curves.theta
    q = world.angles(shared.arm(), world.circle_points(theta))
    ball = world.FIXTURE + truth.offset + world.shift(shared.arm(), truth, way)
    x = world.true_point(shared.arm(), truth, q, np.zeros(len(q)), ball)
    y = np.linalg.norm(x - ball, axis=1)
    A = np.column_stack([np.ones_like(theta), np.sin(theta), np.cos(theta)])
    fitted = np.linalg.lstsq(A, y)[0]
    assert circle.offset.amplitude == pytest.approx(np.hypot(*fitted[1:]), abs=5e-6)
    rest = y - A @ fitted
    assert np.abs(rest).max() > 3e-5
    assert np.abs(circle.kinematic.mean(axis=0) - rest).max() < 1e-5
