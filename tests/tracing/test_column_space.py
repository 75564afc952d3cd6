"""A space that grew from another model's against one laid out anew."""

from dataclasses import replace

import numpy as np
import pytest

import planner.tracing.dictionary as dictionary
from planner.effects.catalogue import Excitation
from planner.effects.steps import steppables
from planner.tracing.change_points import score_steps
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.search_context import without_effects
from planner.tracing.state import FittedEffect
from tests.tracing.test_state import begun
from tests.tracing.worlds import calibrated, effect


@pytest.fixture(scope="module", params=["edbb_static", "tracker"])
def states(request):
    """A state with play, one with a ripple as well, and one with other play in its place; with the catalogue."""
    planted = (effect("reducer-ripple", 3, share=0.3, frequency=9.37, phase=1.0), effect("backlash-approach", 2, 8e-5))
    start, bench, entries = begun(calibrated(planted, traced=False, seed=4, build=request.param, size=300))
    play, wave = FittedEffect(entries["backlash, joint 2"]), FittedEffect(entries["gear ripple, joint 3"], 9.37)
    first = start.refit(bench, (play,))
    second = first.refit(bench, (play, wave))
    third = second.refit(bench, (play, FittedEffect(entries["backlash, joint 4"])))
    return first, second, third, list(entries.values())


def assert_alike(one, other, entries):
    """Alike but for noise and prior sigmas, which the space keeps from the model that it began with."""
    pairs = [(e, e.grid[len(e.grid) // 2]) for e in entries]
    a, b = (t.score(t.lay_out(pairs)) for t in (one, other))
    assert a.gain / one.noise == pytest.approx(b.gain / other.noise, rel=0.1, abs=0.5)
    assert np.array_equal(a.size, b.size)
    things = list(steppables(Excitation(one.model.setup, one.problem.samples)))
    for (_, s), (_, t) in zip(score_steps(one, things), score_steps(other, things), strict=True):
        assert s.gain / one.noise == pytest.approx(t.gain / other.noise, rel=0.15, abs=1.0)


@pytest.mark.slow
def test_columns_that_come(states):
    first, second, _, entries = states
    space = ScoreTest.of(first.fit).space
    grown = ScoreTest.of(second.fit, near=space)
    assert grown.space.before is space, "the noise is near enough"
    assert len(grown.space) == len(second.fit.errors) + len(grown.gone.T)
    assert_alike(grown, ScoreTest.of(second.fit), entries)


def test_columns_that_come_and_go(states):
    _, second, third, entries = states
    grown = ScoreTest.of(third.fit, near=ScoreTest.of(second.fit).space)
    assert grown.gone.shape[1] > 0
    assert_alike(grown, ScoreTest.of(third.fit), entries)


def test_without_what_came(states):
    """Out of a grown space an effect goes as out of one laid out anew."""
    first, second, _, entries = states
    grown = ScoreTest.of(second.fit, near=ScoreTest.of(first.fit).space)
    one, other = (without_effects(t, second.effects[:1]) for t in (grown, ScoreTest.of(second.fit)))
    assert_alike(one, other, entries)


def test_another_noise_begins_anew(states):
    first, second, *_ = states
    space = ScoreTest.of(first.fit).space
    loud = second.fit.problem.with_noise(first.fit.problem.whitener.times(2.0).noise)
    assert ScoreTest.of(replace(second.fit, problem=loud), near=space).space.before is None


def test_a_large_dictionary_in_single_precision_says_the_same(states, monkeypatch):
    """To a millionth of what a column explains, in half of the memory."""
    first, _, _, entries = states
    test, pairs = ScoreTest.of(first.fit), [(e, v) for e in entries for v in e.grid[::40]]
    double = test.lay_out(pairs)
    monkeypatch.setattr(dictionary, "LARGE", 0)
    single = test.lay_out(pairs)
    assert sum(b.phi.nbytes for b in single.blocks) == sum(b.phi.nbytes for b in double.blocks) // 2
    a, b = test.score(single), test.score(double)
    assert np.array_equal(a.size, b.size)
    assert a.gain == pytest.approx(b.gain, rel=1e-4, abs=1e-4 * test.noise)
