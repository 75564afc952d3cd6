"""Evidence of random effects: against the dense covariance of the readings, finite differences, and drawn data."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.identification.posterior_evidence import GaussianPosterior, RandomEffects


def drawn(m, p, seed=0):
    """Three families and one column of known size; noise of two components."""
    rng = np.random.default_rng(seed)
    family = np.append(np.arange(p - 1) % 3, -1)
    columns = rng.normal(size=(m, p)) * rng.uniform(0.3, 3.0, p)
    noise = np.stack([np.ones(m), rng.uniform(0.0, 4.0, m)], axis=1)
    A = rng.normal(size=(5, 5))
    centre = np.array([-1.0, -0.5, 0.2, 0.0, 0.1])
    return RandomEffects(columns, rng.normal(size=m) * 3, family, noise, centre, A @ A.T + np.eye(5))


LOGS = np.array([0.3, -0.7, -1.5, 0.2, -0.4])


@pytest.mark.parametrize(("m", "p"), [(30, 7), (8, 25)])
def test_it_is_the_density_of_the_readings_under_their_dense_covariance(m, p):
    model = drawn(m, p)
    size = np.array([np.exp(LOGS[f]) if f >= 0 else 1.0 for f in model.family])
    noise = model.noise[:, 0] * np.exp(2 * LOGS[3]) + model.noise[:, 1] * np.exp(2 * LOGS[4])
    C = np.diag(noise)
    for j in range(p):
        C = C + size[j] ** 2 * np.outer(model.columns[:, j], model.columns[:, j])
    density = multivariate_normal(np.zeros(m), C).logpdf(model.y)
    found = model.posterior(LOGS)
    assert found.deviance + m * np.log(2 * np.pi) == pytest.approx(-2 * density, rel=1e-10)
    X = model.columns * size
    gain = X.T @ np.linalg.inv(C)
    assert np.allclose(found.mean, gain @ model.y)
    assert np.allclose(found.left, np.diag(np.eye(p) - gain @ X))
    assert np.allclose(found.residual, (model.y - X @ found.mean) / np.sqrt(noise))
    assert np.allclose(found.leverage, np.diag(X @ (np.eye(p) - gain @ X) @ X.T) / noise)


@pytest.mark.parametrize(("m", "p"), [(30, 7), (8, 25)])
def test_the_gradient_is_that_of_finite_differences(m, p):
    model, h = drawn(m, p), 1e-5
    _, slope = model.objective(LOGS)
    each = [(model.objective(LOGS + d)[0] - model.objective(LOGS - d)[0]) / (2 * h) for d in np.eye(len(LOGS)) * h]
    assert np.allclose(slope, each, rtol=1e-6, atol=1e-6)


def test_columns_and_readings_give_the_same():
    """As many columns as readings go one way, one reading less the other; a reading of no weight hardly counts."""
    rng = np.random.default_rng(1)
    columns, y, variance = rng.normal(size=(12, 12)), rng.normal(size=12), np.append(np.ones(11), 1e12)
    a = GaussianPosterior.of(columns, y, variance)
    b = GaussianPosterior.of(columns[:11], y[:11], variance[:11])
    assert np.allclose(a.mean, b.mean, atol=1e-6)
    assert np.allclose(a.left, b.left, atol=1e-6)


def test_sizes_of_drawn_effects_are_found():
    """Forty runs: families of size 2 and 0.05 and the noise come out within their scatter, without a prior's help."""
    logs = []
    for seed in range(40):
        rng = np.random.default_rng([3, seed])
        columns, family = rng.normal(size=(200, 60)), np.repeat([0, 1], 30)
        z = rng.normal(size=60) * np.array([2.0, 0.05])[family]
        y = columns @ z + rng.normal(size=200) * 0.5
        model = RandomEffects(columns, y, family, np.ones((200, 1)), np.zeros(3), 1e-6 * np.eye(3))
        logs.append(model.learn().logs)
    found = np.median(logs, axis=0)
    assert found[0] == pytest.approx(np.log(2.0), abs=0.06)
    assert found[1] < np.log(0.1)
    assert found[2] == pytest.approx(np.log(0.5), abs=0.05)
