"""Stated uncertainties against thousands of cheap fits of arms whose truth is known."""

import numpy as np
import pytest
from scipy import stats

from planner.fit.identifiable_parameters import identifiable_subset
from planner.model.model import Model
from tests.identification.worlds import Trials, covered, declared, trials, world
from tests.simulation.generator.truth import draw_errors

pytestmark = pytest.mark.long

FITS = 700  # a robot


def band(fits, comparisons, level=0.95, risk=1e-3):
    """Least and largest count of ``fits`` that correct intervals leave by chance once in 1/risk tests."""
    tail = risk / comparisons / 2
    return stats.binom.ppf(tail, fits, level), stats.binom.isf(tail, fits, level)


def joint(t: Trials):
    """Where each fit's χ² stands among what a correct covariance gives, (fits,) in 0 … 1: even, if it is right."""
    return stats.f.cdf(t.square / t.P, t.P, t.freedom)


@pytest.fixture(scope="module", params=["comau-nj130", "kuka-kr6-r700"])
def static(request):
    w = world(request.param, 80)
    return trials(w, FITS, declared(w), seed=1)


def test_truth_is_regrouped_without_rest(static):
    """What the parameters that were left out do is done as well by those that were kept, to a part of the noise."""
    assert static.left.max() < 5e-8  # [m]; the noise is 3e-6 and more


def test_intervals_hold_each_parameter_as_often_as_they_say(static):
    low, high = band(FITS, static.P)
    count = covered(static)
    assert np.all((count >= low) & (count <= high)), dict(zip(static.names, count / FITS, strict=True))


def test_intervals_are_right_at_other_levels_too(static):
    for level in (0.5, 0.8, 0.99):
        low, high = band(FITS, 3 * static.P, level)
        count = covered(static, level)
        assert np.all((count >= low) & (count <= high)), (level, dict(zip(static.names, count / FITS, strict=True)))


def test_no_parameter_is_biased(static):
    mean = static.z.mean(axis=0) * np.sqrt(FITS)
    assert np.abs(mean).max() < stats.norm.isf(1e-3 / 2 / static.P)


def test_all_parameters_together_are_as_uncertain_as_stated(static):
    where = joint(static)
    assert stats.kstest(where, "uniform").pvalue > 1e-3
    mean = np.mean(static.square / static.P)
    expected = np.mean(static.freedom / (static.freedom - 2))
    assert abs(mean / expected - 1) < 4 * np.std(static.square) / np.mean(static.square) / np.sqrt(FITS)


def test_left_out_directions_are_what_regrouping_needs():
    """The planner's own null directions regroup small errors as the generator's projection does, to first order."""
    w = world("comau-nj130", 80)
    whole = Model.of(w.model.setup, w.cell.plan.free)
    seen = identifiable_subset(whole, w.run.samples)[1]
    assert seen.names == w.names
    errors = draw_errors(w.arm, np.random.default_rng(3), 1e-6, 1e-6, 1e-6, 1e-6)
    moved = {n: errors.get(n, 0.0) for n in whole.names}
    for d in seen.dropped:
        direction = dict(d.direction)
        share = errors[d.name] / direction[d.name]
        moved = {n: v - share * direction.get(n, 0.0) for n, v in moved.items()}
    assert np.allclose([moved[n] for n in w.names], w.regrouped(errors)[0], atol=1e-10)
    assert all(abs(moved[d.name]) < 1e-15 for d in seen.dropped)
