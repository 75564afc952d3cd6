"""The weights of robust fits against scipy's losses: a weight is the loss's slope, a cost its value."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from planner.common.robust import (
    HUBER_SIGMAS,
    MEDIAN_NORM,
    huber_costs,
    huber_weights,
    tukey_costs,
    tukey_weights,
)

SIZE = np.array([0.0, 1e-14, 0.3, 1.4, 1.5, 1.6, 4.0, 70.0])


@pytest.mark.parametrize(("weights", "costs"), [(huber_weights, huber_costs), (tukey_weights, tukey_costs)])
def test_a_weight_is_the_slope_of_the_cost_over_twice_the_size(weights, costs):
    step = 1e-6
    slope = (costs(SIZE[2:] + step, 1.7) - costs(SIZE[2:] - step, 1.7)) / (2 * step)
    np.testing.assert_allclose(weights(SIZE[2:], 1.7), slope / (2 * SIZE[2:]), atol=1e-9)
    np.testing.assert_array_equal(weights(SIZE[:2], 1.7), 1.0)


def test_scipys_huber_loss_costs_the_same():
    """Its ``cost`` is half the sum of the losses."""
    for size in SIZE:
        found = least_squares(lambda x, r=size: np.array([r]) + 0 * x, [0.0], loss="huber", f_scale=1.7, max_nfev=1)
        assert 2 * found.cost == pytest.approx(float(huber_costs(size, 1.7)), rel=1e-12, abs=1e-30)


def test_hubers_limit_is_as_sharp_as_it_says():
    """Efficiency at the normal law (Huber 1981, 4.2): 95 % or better; more than 97 % would let outliers pull."""
    x = np.linspace(-12, 12, 200_001)
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    psi = x * huber_weights(np.abs(x), HUBER_SIGMAS)
    inside = np.trapezoid(density * (np.abs(x) < HUBER_SIGMAS), x)
    assert 0.95 < inside**2 / np.trapezoid(density * psi**2, x) < 0.97


def test_medians_are_those_of_chi_square():
    for numbers, median in MEDIAN_NORM.items():
        assert median == pytest.approx(np.sqrt(chi2.ppf(0.5, numbers)), abs=6e-5)


def test_the_smallest_sizes_weigh_one_and_what_is_no_number_stays_none():
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(huber_weights(np.array([0.0, 5e-324, 1.7]), 1.7), 1.0)
        np.testing.assert_array_equal(huber_weights(np.array([0.0, 2.0]), 0.0), [1.0, 0.0])
    assert np.isnan(huber_weights(np.array([np.nan]), 1.7)).all()
