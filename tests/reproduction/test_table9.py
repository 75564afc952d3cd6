"""The simulated arm of the reproduction: complete models bring it back, and a bar may reach what a tracker does."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

import tests.reproduction.instruments as instruments
import tests.reproduction.judge as judge
from planner.reproduction.published import paper_numbers
from tests.reproduction.instruments import bar_run, identified, tracked
from tests.reproduction.judge import as_planted, validated
from tests.reproduction.planned import of_bar
from tests.reproduction.table9 import SIZE, Row
from tests.reproduction.truth import hidden

pytestmark = pytest.mark.long

SESSION = (1, 1, 200, "tracing")


@pytest.fixture(scope="module", autouse=True)
def fewer_validation_poses():
    """150 poses tell a mean as well as the 500 of the table, in a third of the time of planning them."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (instruments, judge):
            patch.setattr(module, "VALIDATED", 150)
        yield


@cache
def session():
    return of_bar(*SESSION)


def test_without_further_effects_the_bar_and_the_tracker_bring_the_arm_back():
    for measured in (tracked(), bar_run(session())):
        found = identified(measured, traced=False)
        assert validated(found, measured).row[1] < 0.08, measured.name
        value, count = as_planted(found)
        assert count > 15
        assert chi2.sf(value, count) > 1e-4, measured.name


def test_one_published_figure_sizes_the_arms_and_the_others_are_predicted():
    """The mean that the tracker leaves sizes what its model lacks; of other figures that mean says nothing."""
    left = []
    for seed in range(5):
        more = hidden(SIZE, seed)
        measured = tracked(more, seed)
        left.append(validated(identified(measured, traced=False), measured, more).row)
    mean, largest, std = np.mean(left, axis=0)
    published = paper_numbers().table_9.tracker_mm
    assert mean == pytest.approx(published[0], rel=0.1)  # 150 of the 500 poses
    assert published[1] < largest < 1.4 * published[1]  # 0.696 of 0.539 mm at all 500: gears that err in few places
    assert published[2] < std < 1.5 * published[2]


def test_a_traced_bar_is_no_worse_than_the_tracker_whose_model_lacks_the_same(monkeypatch):
    for module in (instruments, judge):
        monkeypatch.setattr(module, "VALIDATED", 500)  # as in the table: the largest of few poses is chance
    more = hidden(SIZE)
    measured, bar = tracked(more), bar_run(session(), more)
    tracker = Row(measured, False, validated(identified(measured, traced=False), measured, more), None)
    found = identified(bar, traced=True)
    traced = Row(bar, True, validated(found, bar, more), found)
    assert 0.15 < tracker.errors.row[0] < 0.35  # of the published order
    assert traced.errors.row[0] < tracker.errors.row[0]
    assert traced.errors.row[1] < tracker.errors.row[1]
    assert "gear error curve, joints 1, 2, 3, 4, 5" in {f.name for f in found.findings}  # many of one kind are one
