"""The tests of a check against draws of their own, and against what other libraries make of the same numbers."""

import numpy as np
import pytest
from scipy import stats

from planner.checks.assumptions import FALSE_ALARM, POWER
from planner.checks.detection import Detector

N = 10


@pytest.fixture(scope="module")
def detector():
    """Ten readings that share errors, one of them a zero that is hardly known; changes of one to nine parameters."""
    rng = np.random.default_rng(3)
    shared = rng.normal(size=(N, 4))
    covariance = 1e-10 * (np.eye(N) + shared @ shared.T) + 1e-6
    columns = tuple(rng.normal(size=(N, d)) for d in (1, 1, 1, 1, 2, 2, 3, 3, 9))
    return Detector(covariance, columns, 60.0)


def sound(detector, count, rng):
    """Differences (m, n) of robots in which nothing has changed, whose noise was estimated."""
    scale = np.sqrt(rng.chisquare(detector.freedom, count) / detector.freedom)
    return rng.standard_normal((count, N)) @ np.linalg.cholesky(detector.covariance).T / scale[:, None]


def alarms(detector, differences):
    """Whether each gives an alarm."""
    return np.array([min(e.p_value for e in detector.explain(d)) < detector.threshold for d in differences])


@pytest.mark.slow
def test_sound_robots_give_an_alarm_as_rarely_as_stated(detector):
    rate = alarms(detector, sound(detector, 1500, np.random.default_rng(8)))
    assert stats.binom.sf(rate.sum() - 1, len(rate), FALSE_ALARM) > 1e-3
    assert rate.any()  # a test that never fires shows nothing


@pytest.mark.parametrize("which", [0, 4, 6])
def test_a_change_of_the_stated_size_is_found_as_often_as_stated(detector, which):
    """In the direction that shows least, which the size is stated for."""
    columns = detector.columns[which]
    d = columns.shape[1]
    information = columns.T @ np.linalg.solve(detector.covariance, columns)
    way = np.linalg.eigh(information)[1][:, 0] * detector.detectable_motion(which, np.eye(d))
    changed = sound(detector, 400, np.random.default_rng([9, which])) + columns @ way
    found = alarms(detector, changed).sum()
    assert stats.binom.cdf(found, 400, POWER) > 1e-3
    smaller = sound(detector, 400, np.random.default_rng([10, which])) + 0.3 * columns @ way
    assert alarms(detector, smaller).sum() < 0.5 * 400


def test_estimates_are_those_of_generalised_least_squares(detector):
    difference = np.random.default_rng(1).normal(size=N) * 1e-5
    root = np.linalg.cholesky(detector.covariance)
    for k, columns in enumerate(detector.columns[:8]):
        white, y = np.linalg.solve(root, columns), np.linalg.solve(root, difference)
        values, left, *_ = np.linalg.lstsq(white, y)
        got, covariance = detector.estimate(k, np.full(columns.shape[1], 7.0), difference)
        assert np.allclose(got, values)
        assert np.allclose(covariance, np.linalg.inv(white.T @ white))
        assert detector.explain(difference)[k].explained == pytest.approx(y @ y - left[0])
