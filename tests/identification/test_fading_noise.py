"""How long noise stays alike, read from a residual of which the fit has taken a part."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from planner.fit.fading_noise import correlate, fading_of_residual, window_sums, window_time

SAMPLES, COLUMNS = 1500, 25


def slow_basis(rng):
    """Columns that change slowly along a drive, orthonormal, (n, 1, k)."""
    waves = np.outer(np.arange(SAMPLES), rng.uniform(0.003, 0.06, COLUMNS)) + rng.uniform(0, 6, COLUMNS)
    return np.linalg.qr(np.sin(waves))[0][:, None]


def noise(rng, time):
    """Noise of unit variance whose integrated autocorrelation time is ``time`` samples, (n,)."""
    rho = (time - 1) / (time + 1)
    return np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], rng.standard_normal(SAMPLES + 500))[500:]


@pytest.mark.parametrize("time", [1.0, 8.0, 20.0])
def test_the_time_is_that_of_the_noise_and_not_of_what_the_fit_left_of_it(time):
    found, read = [], []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        basis, x = slow_basis(rng), noise(rng, time)
        left = (x - basis[:, 0] @ (basis[:, 0].T @ x))[:, None]
        rho = fading_of_residual(left, basis)
        found.append((1 + rho) / (1 - rho))
        read.append(window_time(left))
    assert np.median(found) == pytest.approx(time, rel=0.2, abs=0.1)
    assert time == 1.0 or np.median(read) < 0.85 * time  # what it would be without


def test_products_with_both_matrices_are_those_of_dense_ones():
    columns = np.random.default_rng(0).standard_normal((40, 2, 3))
    near = toeplitz(np.arange(40) <= 4).astype(float)
    fading = toeplitz(0.7 ** np.arange(40))
    np.testing.assert_allclose(window_sums(columns, 4), np.einsum("ij,jrk->irk", near, columns), atol=1e-12)
    np.testing.assert_allclose(correlate(columns, 0.7), np.einsum("ij,jrk->irk", fading, columns), atol=1e-12)
