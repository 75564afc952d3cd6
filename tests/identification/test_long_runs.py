"""A long run is fitted by some thousand rows, evenly over all of it, and that is as good as all of them."""

import numpy as np
import pytest

from planner.fit.run_setup import number_samples, spread_rows
from planner.identification.pipeline import FitSettings, identify
from tests.identification.worlds import declared, world
from tests.simulation.generator.truth import draw_errors


def test_rows_of_a_long_run_are_left_out_evenly():
    run = number_samples(world(n=20_000, motion="continuous").run)
    for width, count in ((1, 8_000), (6, 4_000), (100, 500)):
        few = spread_rows(run, width)
        assert len(few) == count
        steps = np.diff(few.samples.number)
        assert (few.samples.number[0], few.samples.number[-1]) == (0, 19_999)
        assert np.ptp(steps) <= 1
        assert np.array_equal(few.readings.length, run.readings.length[few.samples.number])
        assert np.array_equal(few.samples.speed, run.samples.speed[few.samples.number])  # told by the rows between
    assert len(spread_rows(run.take(slice(400)), 1)) == 400


@pytest.mark.slow
def test_the_rows_that_are_left_show_what_all_of_them_show():
    w = world(n=20_000, motion="continuous")
    rng = np.random.default_rng(3)
    run = w.measured(draw_errors(w.arm, rng, 4e-4, 5e-4), declared(w), rng)
    found = identify(run, w.cell, settings=FitSettings(release=False))
    assert found.n_samples == 8_000
    assert any("8000 of 20000 rows" in text for text in found.warnings)
    every, covariance = w.fitted(run)
    assert found.fit is not None
    off = found.fit.at(w.names) - every.errors
    assert (np.abs(off) < 1.5 * np.sqrt(np.diag(covariance))).all()
