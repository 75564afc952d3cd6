"""Which change it was: probabilities against changes that were drawn, and against densities by SciPy."""

import numpy as np
import pytest
from scipy import stats

from planner.checks.detection import Detector
from planner.checks.evaluation import weigh_changes

N, WIDTHS = 10, (1, 1, 1, 2, 3, 6)
SIZES = np.geomspace(1e-5, 1e-2, 13)


@pytest.fixture(scope="module")
def detector():
    """Ten readings that share errors, and changes of one to six parameters, each a metre of motion a metre."""
    rng = np.random.default_rng(3)
    shared = rng.normal(size=(N, 4))
    covariance = (2e-5) ** 2 * (np.eye(N) + shared @ shared.T)
    return Detector(covariance, tuple(rng.normal(size=(N, d)) for d in WIDTHS), 40.0)


def weigh(detector, difference):
    return weigh_changes(detector, [np.ones(d) for d in WIDTHS], difference, N)


def noise(detector, rng):
    scale = np.sqrt(rng.chisquare(detector.freedom) / detector.freedom)
    return np.linalg.cholesky(detector.covariance) @ rng.standard_normal(N) / scale


def test_the_change_that_was_made_is_named(detector):
    rng = np.random.default_rng(1)
    for k, columns in enumerate(detector.columns):
        way = rng.standard_normal(columns.shape[1])
        found = weigh(detector, columns @ way / np.linalg.norm(way) * 2e-3 + noise(detector, rng))
        assert found.changes[k] > 0.95
        assert found.wrong_reading is None


def test_one_wrong_reading_is_named(detector):
    rng = np.random.default_rng(2)
    for k in range(N):
        assert weigh(detector, 3e-3 * np.eye(N)[k] + noise(detector, rng)).wrong_reading == k


@pytest.mark.long
def test_probabilities_are_as_often_right_as_they_say(detector):
    """Changes drawn as the weights say that they are: of those with a probability of p a share p is the right one."""
    rng, chances, hits = np.random.default_rng(4), [], []
    for k in range(160):
        which = k % (len(WIDTHS) + 2)
        size = rng.choice(SIZES)
        if which < len(WIDTHS):
            change = detector.columns[which] @ rng.standard_normal(WIDTHS[which]) * size / np.sqrt(WIDTHS[which])
        elif which == len(WIDTHS):
            change = rng.standard_normal(N) * size / np.sqrt(N)
        else:
            change = np.eye(N)[rng.integers(N)] * rng.standard_normal() * size
        found = weigh(detector, change + noise(detector, rng))
        every = np.array([*found.changes, found.anything, found.readings.sum()])
        assert every.sum() == pytest.approx(1.0)
        chances.append(every)
        hits.append(np.eye(len(every))[which])
    chances, hits = np.ravel(chances), np.ravel(hits)
    for low, high in ((0.0, 0.05), (0.05, 0.3), (0.3, 0.8), (0.8, 1.01)):
        here = (chances >= low) & (chances < high)
        expected, spread = chances[here].sum(), np.sqrt((chances[here] * (1 - chances[here])).sum())
        assert abs(hits[here].sum() - expected) < 3 * spread + 1


@pytest.mark.slow
def test_weights_are_those_of_normal_densities_averaged_over_the_noise(detector):
    rng = np.random.default_rng(5)
    difference = detector.columns[3] @ np.array([6e-5, -4e-5]) + noise(detector, rng)
    found = weigh(detector, difference)
    logs = []
    for columns, d in zip(detector.columns, WIDTHS, strict=True):
        each = []
        for size in SIZES / np.sqrt(d):
            # of what changes the size is in metres, whatever the noise really is: averaged over it by quadrature
            scale = detector.freedom / stats.chi2.ppf((np.arange(40) + 0.5) / 40, detector.freedom)
            each += [
                stats.multivariate_normal.logpdf(
                    difference, cov=detector.covariance * s + size**2 * columns @ columns.T
                )
                for s in scale
            ]
        logs.append(np.logaddexp.reduce(each))
    chance = np.exp(np.array(logs) - max(logs))
    np.testing.assert_allclose(found.changes / found.changes.sum(), chance / chance.sum(), atol=0.01)
