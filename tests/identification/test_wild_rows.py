"""Rows far outside the noise: what is fitted with them is what is fitted without, and clean runs stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from planner.fit.assumptions import WILD_PROBABILITY, WILD_SCALES
from planner.fit.covariance import parameter_covariance
from planner.fit.least_squares import Fit, fit
from planner.fit.problem import FitProblem
from planner.fit.wild_rows import expected_weights, row_weights, validation_weights, wild_cost
from planner.inference.misfit import RepeatedReadings
from planner.inference.posterior_draws import RandomEffects, SizeDraw, SizePrior
from planner.runs.run import Run
from tests.identification.worlds import declared, world
from tests.simulation.generator.truth import draw_errors

WIDTHS = (1, 3, 6)
ROWS = np.array([7, 40, 41, 99])  # that are wild: two neighbours, and two alone


def among_others(size: float, width: int, n: int = 200) -> np.ndarray:
    """Numbers (n, width) of standard normal noise, the first row of a length of its own."""
    out = np.random.default_rng(width).standard_normal((n, width))
    out[0] = size / np.sqrt(width)
    return out


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("size", [4.5, 5.0, 7.0, 20.0, 4e3])
def test_a_weight_is_the_expected_inverse_square_of_the_scale(width, size):
    """By numerical integration over the logarithm of the scale; ``bulk`` is the scale that nine rows in ten show."""
    square = np.full(width, size**2 / width)
    own = expected_weights(np.vstack([square, np.ones((400, width))]), np.full((401, width), 0.3))
    low, high = np.log(WILD_SCALES)

    def density(log: float) -> float:
        return float(norm.pdf(np.sqrt(square), scale=np.sqrt(np.exp(2 * log) + 0.3)).prod())

    points = np.log(size) + np.linspace(-3.0, 3.0, 7)
    spread = [
        quad(lambda s, k=k: density(s) * np.exp(-k * s) / (high - low), low, high, limit=400, points=points)[0]
        for k in (0, 2)
    ]
    near, far = (1 - WILD_PROBABILITY) * density(0.0), WILD_PROBABILITY * spread[0]
    wild, small = far / (near + far), spread[1] / spread[0]
    expected = min(1.0, 2 * (1 - wild)) * (1 - small) + small
    assert own[0] == pytest.approx(expected, rel=0.06)
    assert np.all(own[1:] == 1.0)


def test_up_to_even_odds_a_row_counts_in_full_and_normal_noise_hardly_ever_less():
    for width in WIDTHS:
        noise = np.random.default_rng(width).standard_normal((20_000, width))
        weight = row_weights(noise, np.zeros_like(noise), np.ones(len(noise)))
        assert (weight < 1.0).mean() < 2e-4
        alone = [
            float(row_weights(among_others(s, width), np.zeros((200, width)), np.ones(200))[0]) for s in (3.0, 60.0)
        ]
        assert alone[0] == 1.0
        assert alone[1] < 0.01


def test_a_cause_that_acts_in_more_rows_than_one_in_ten_makes_none_of_them_wild():
    noise = np.random.default_rng(5).standard_normal((120, 1))
    noise[::8] += 12.0
    assert np.all(row_weights(noise, np.zeros_like(noise), np.ones(120)) == 1.0)


def test_what_wild_rows_cost_is_their_density_beside_that_of_the_noise():
    """Two rows that no noise explains cost as two draws from the tail; all others nothing."""
    white = np.array([[0.5], [40.0], [-300.0]])
    weight = np.array([1.0, 1e-3, 1e-5])
    tail = np.log(np.exp(norm.logpdf(0.0)) * 0 + 1 / np.diff(np.log(WILD_SCALES))[0] / (2 * np.abs(white[1:, 0])))
    expected = -2 * (tail + np.log(WILD_PROBABILITY)) - np.log(2 * np.pi) - weight[1:] * white[1:, 0] ** 2
    assert wild_cost(white, weight) == pytest.approx(float(expected.sum()), rel=0.02)
    assert wild_cost(white[:1], weight[:1]) == 0.0


@pytest.fixture(scope="module")
def measured() -> Run:
    """A bar at rest, its arm with errors of its own."""
    w = world("comau-nj130", 120)
    rng = np.random.default_rng(21)
    return w.measured(draw_errors(w.arm, rng), declared(w), rng)


def spoilt(run: Run, off: float) -> Run:
    """The run with four wild rows, off by so much [m], either way."""
    length = np.array(run.readings.length)
    length[ROWS] += off * np.array([1.0, -0.8, 0.9, -1.2])
    return replace(run, readings=replace(run.readings, length=length))


def fitted(run: Run) -> Fit:
    """The fit of a run of the world."""
    return fit(FitProblem.of(world("comau-nj130", 120).model, run))


def test_without_wild_rows_all_count_in_full(measured):
    assert np.all(fitted(measured).problem.weight == 1.0)


@pytest.mark.parametrize("off", [3e-4, 5e-3, 5e-2])
def test_with_wild_rows_the_fit_is_that_of_the_others(measured, off):
    found, alone = fitted(spoilt(measured, off)), fitted(measured.take(np.delete(np.arange(120), ROWS)))
    sigma = np.sqrt(np.diag(parameter_covariance(alone, False)[0]))
    assert np.abs((found.errors - alone.errors) / sigma).max() < 0.15
    assert np.flatnonzero(found.problem.weight < 0.5).tolist() == ROWS.tolist()
    stated = np.sqrt(np.diag(parameter_covariance(found, False)[0]))
    assert np.abs(np.log(stated / sigma)).max() < 0.1


def test_repeats_of_which_one_is_wild_tell_the_noise_of_the_others(measured):
    """Every pose measured twice, twice one of the two is wild: the scatter of repeats is that of the rest."""
    twice = np.concatenate([np.arange(120), np.arange(120)])
    w, rng = world("comau-nj130", 120), np.random.default_rng(3)
    again = measured.take(twice)
    length = np.array(again.readings.length) + 4e-6 * rng.standard_normal(240)
    clean = replace(again, readings=replace(again.readings, length=length))
    wild = spoilt(clean, 4e-4)
    told = [RepeatedReadings.of(fit(FitProblem.of(w.model, run)), run) for run in (clean, wild)]
    assert told[1].freedom == told[0].freedom - len(ROWS)
    assert told[1].square / told[1].freedom == pytest.approx(told[0].square / told[0].freedom, rel=0.15)


def test_the_draws_hold_each_row_against_all_others():
    """By the dense formula: what others say of reading k is off by (C⁻¹y)ₖ / (C⁻¹)ₖₖ, with that variance inverse."""
    rng = np.random.default_rng(8)
    columns, family = rng.normal(size=(60, 9)), np.repeat([-1, 0, 1], 3)
    weight = np.ones(60)
    weight[11] = 0.01
    prior = SizePrior(np.array([0.0, 0.5]), np.array([0.5, 0.5]))
    noise = np.full((60, 1), 0.04)
    y = columns[:, :6] @ rng.normal(size=6) * 0.4 + 0.2 * rng.standard_normal(60)
    y[11] += 3.0
    model = RandomEffects(columns, y, family, noise, (prior, prior), np.eye(1), np.arange(60), weight)
    draw = SizeDraw(np.array([0.5, 0.0]), np.array([0.1]))
    size = np.where(family < 0, 1.0, np.where(family == 0, 0.5, 0.0))
    variance = 0.04 * np.exp(0.2)
    inverse = np.linalg.inv((columns * size**2) @ columns.T + np.diag(variance / weight))
    left, spread = (inverse @ y) / np.diag(inverse), 1 / np.diag(inverse)
    others = spread - variance / weight
    expected = expected_weights((left**2 / variance)[:, None], (others / variance)[:, None])
    np.testing.assert_allclose(model.weigh_rows(model.at(draw)), expected, rtol=1e-6)
    assert expected[11] < 0.1
    assert np.delete(expected, 11).min() == 1.0
    assert multivariate_normal(cov=np.linalg.inv(inverse)).logpdf(y) < 0.0


def test_a_validation_has_wild_rows_by_what_most_of_it_is_off():
    rng = np.random.default_rng(2)
    residual = 5e-5 * rng.standard_normal((40, 3))
    assert np.all(validation_weights(residual) == 1.0)
    residual[[3, 20]] += [[4e-4, 0.0, 0.0], [0.0, 5e-2, 0.0]]
    assert np.flatnonzero(validation_weights(residual) < 0.5).tolist() == [3, 20]
