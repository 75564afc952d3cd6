"""A refit that stays linear about a state against one that fits everything anew."""

import numpy as np
import pytest

from planner.tracing.effect_scores import ScoreTest
from planner.tracing.linear_refit import LinearState
from planner.tracing.significance import held_out_gain, wald_statistic
from planner.tracing.state import FittedEffect
from planner.tracing.transmission_error import likeliest_curve
from tests.tracing.test_state import begun
from tests.tracing.worlds import calibrated, effect


@pytest.fixture(scope="module", params=["edbb_static", "tracker"])
def bench(request):
    """A run with a ripple and play, its bench and the catalogue; the state has the play already."""
    planted = (
        effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),
        effect("backlash-approach", 2, 8e-5),
    )
    start, bench, entries = begun(calibrated(planted, traced=False, seed=4, build=request.param, size=300))
    return start.refit(bench, (FittedEffect(entries["backlash, joint 2"]),)), bench, entries


def assert_alike(state, bench, effects):
    """Alike but for the ratio of the noise of gauge and joints, which a linear refit keeps."""
    quick, slow = LinearState.of(state, bench).refit(effects), state.refit(bench, effects)
    one, other = quick.effects[-1], slow.effects[-1]
    sigma = np.linalg.norm(slow.fit.solution.root(slow.fit.problem.prior)[slow.positions(other)], axis=1)
    assert np.abs((quick.sizes(one) - slow.sizes(other)) / sigma).max() < 3.0
    if one.value is not None:
        assert one.value == pytest.approx(other.value, rel=3e-3)
    assert state.evidence() - quick.evidence() == pytest.approx(state.evidence() - slow.evidence(), rel=0.12)
    gains = [held_out_gain(state, s, bench) for s in (quick, slow)]
    assert gains[0] == pytest.approx(gains[1], abs=0.01)
    walds = [wald_statistic(s, s.effects[-1])[0] for s in (quick, slow)]
    assert walds[0] == pytest.approx(walds[1], rel=0.4)


def test_a_wave_of_another_frequency(bench):
    state, fold, entries = bench
    assert_alike(state, fold, (*state.effects, FittedEffect(entries["gear ripple, joint 3"], 9.25)))


def test_one_effect_in_the_place_of_another(bench):
    state, fold, entries = bench
    assert_alike(state, fold, (FittedEffect(entries["gear ripple, joint 3"], 9.3),))


def test_a_whole_curve(bench):
    state, fold, _ = bench
    curve = likeliest_curve(ScoreTest.of(state.fit), 2)
    assert_alike(state, fold, (*state.effects, FittedEffect(curve)))


def test_columns_are_those_of_the_fit(bench):
    state, fold, entries = bench
    quick = LinearState.of(state, fold).refit((FittedEffect(entries["gear ripple, joint 3"], 9.3),))
    again = quick.fit.problem.piece(slice(None), quick.fit.errors)
    scale = np.linalg.norm(quick.piece.columns[0]) / np.linalg.norm(again.columns[0])  # of the noise
    assert quick.piece.columns == pytest.approx(again.columns * scale, rel=0.01, abs=0.01 * np.abs(again.columns).max())
    assert quick.piece.residual == pytest.approx(again.residual * scale, abs=0.02)


def test_the_state_itself(bench):
    state, fold, _ = bench
    same = LinearState.of(state, fold).refit(state.effects)
    assert same.fit.errors == pytest.approx(state.fit.errors, rel=1e-3, abs=1e-9)
    assert same.evidence() == pytest.approx(state.evidence(), abs=0.1)
    assert same.stage.held_residual == pytest.approx(state.stage.held_residual, abs=1e-7)
    assert same.stage.residual == pytest.approx(state.stage.residual, abs=1e-7)
