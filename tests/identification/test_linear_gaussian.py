"""The linear model with normal errors against dense textbook formulas and SciPy's multivariate normal density."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.model.linear_gaussian import LinearGaussian

SIZES = [(30, 7), (8, 25)]  # more readings than parameters, and fewer


def world(n, p, wide=1.0):
    """A model of which every third parameter is absent, and readings; ``wide``: prior of the first one."""
    rng = np.random.default_rng([n, p])
    prior = np.where(np.arange(p) % 3 == 2, 0.0, rng.uniform(0.2, 2.0, p))
    prior[0] = wide
    model = LinearGaussian(rng.normal(size=(n, p)), prior, rng.uniform(0.3, 1.5, n))
    return model, rng.normal(size=n) * 2


def dense(model):
    """The covariance of the readings."""
    return np.diag(model.noise**2) + (model.columns * model.prior**2) @ model.columns.T


def same(here, there):
    """Whether two arrays agree to nine digits of the largest number."""
    return np.abs(here - there).max() <= 1e-9 * np.abs(there).max()


@pytest.mark.parametrize(("n", "p"), SIZES)
def test_the_evidence_is_the_density_of_the_readings(n, p):
    model, y = world(n, p)
    assert same(model.log_evidence(y), multivariate_normal(np.zeros(n), dense(model)).logpdf(y))


@pytest.mark.parametrize(("n", "p"), SIZES)
def test_marginals_and_predictions_are_those_of_the_joint_normal_distribution(n, p):
    """Conditional mean and covariance of parameters and of other readings, by the blocks of their joint covariance."""
    model, y = world(n, p)
    rows, S = np.random.default_rng(3).normal(size=(5, p)), np.diag(model.prior**2)
    gain = S @ model.columns.T @ np.linalg.inv(dense(model))
    mean, covariance = gain @ y, S - gain @ model.columns @ S
    which = np.array([0, 3, 4])
    found = model.marginal(y, which)
    assert same(found.mean, mean[which])
    assert same(found.covariance, covariance[np.ix_(which, which)])
    assert same(model.mean(y), mean)
    assert same(model.variance(), np.diag(covariance))
    ahead = model.predict(rows, y)
    assert same(ahead.mean, rows @ mean)
    assert same(ahead.covariance, rows @ covariance @ rows.T)


@pytest.mark.parametrize(("n", "p"), SIZES)
def test_an_update_is_the_model_with_the_other_priors(n, p):
    """Parameters that come, go, and change; several such changes one after the other."""
    model, y = world(n, p)
    which, prior = np.array([0, 1, 2, 4]), np.array([0.0, 3.0, 1.5, 0.1])
    now = model.update(which, prior).update(slice(3, 5), 0.7).update(np.array([2]), 0.0)
    own = model.prior.copy()
    own[which] = prior
    own[3:5], own[2] = 0.7, 0.0
    anew = LinearGaussian(model.columns, own, model.noise)
    assert np.array_equal(now.prior, own)
    assert same(now.inverse, np.linalg.inv(dense(anew)) * np.outer(model.noise, model.noise))
    assert same(now.log_evidence(y), multivariate_normal(np.zeros(n), dense(anew)).logpdf(y))
    assert same(now.products(slice(0, 4)), model.columns[:, :4].T @ np.linalg.inv(dense(anew)) @ model.columns[:, :4])


@pytest.mark.parametrize(("n", "p"), SIZES)
def test_noise_is_scaled_as_if_it_had_been_declared_so(n, p):
    model, y = world(n, p)
    anew = LinearGaussian(model.columns, model.prior, model.noise * 0.3)
    assert same(model.scale_noise(0.3).inverse, anew.inverse)
    assert same(model.scale_noise(0.3).log_evidence(y), multivariate_normal(np.zeros(n), dense(anew)).logpdf(y))


@pytest.mark.parametrize(("n", "p"), SIZES)
def test_a_prior_wider_than_the_noise_by_seven_orders_leaves_what_it_does_not_reach(n, p):
    """Against the limit of a prior that says nothing: the readings beside the first column (Schur complement)."""
    model, _ = world(n, p, wide=1e7)
    other = LinearGaussian(model.columns, np.append(0.0, model.prior[1:]), model.noise)
    inverse, x = np.linalg.inv(dense(other)), model.columns[:, 0]
    limit = inverse - np.outer(inverse @ x, inverse @ x) / (x @ inverse @ x)
    assert same(model.inverse, limit * np.outer(model.noise, model.noise))
