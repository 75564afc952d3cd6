"""The simulated arm of the reproduction: complete models bring it back, and a bar may reach what a tracker does."""

from scipy.stats import chi2

from tests.reproduction.instruments import bars, identified, tracked, tricentred
from tests.reproduction.judge import as_planted, validated, validation
from tests.reproduction.table9 import SIZE, quickest, rows
from tests.reproduction.truth import hidden


def test_without_further_effects_the_bar_and_the_tracker_bring_the_arm_back():
    q, x = validation()
    for measured in (tracked(), tricentred(), bars(1, 1, 80)):
        found = identified(measured, traced=False)
        assert validated(found, q, x).row[1] < 0.05, measured.name
        value, count = as_planted(found)
        assert count > 15
        assert chi2.sf(value, count) > 1e-4, measured.name


def test_a_traced_bar_is_no_worse_than_the_tracker_whose_model_lacks_the_same():
    more = hidden(SIZE)
    q, x = validation(more)
    tracker = validated(identified(tracked(more), traced=False), q, x)
    bar = validated(identified(bars(1, 1, 400, more), traced=True), q, x)
    assert 0.15 < tracker.row[0] < 0.35  # of the published order
    assert bar.row[0] < 0.5 * tracker.row[0]
    assert bar.row[1] < 0.539


def test_the_quickest_plan_is_a_bar_that_reaches_the_goal():
    table = list(rows(0.0, ((1, 1, 80),), say=lambda _: None))
    best = quickest(table)
    assert best is not None
    assert "bar" in best.measured.name
