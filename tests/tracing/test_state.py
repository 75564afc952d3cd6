"""The model with its effects: inner numbers on the way, and weights that must not stand in for what they load."""

import pytest

import planner.tracing.state as states
from planner.effects.catalogue import catalogue
from planner.identification.cross_validation import split_run
from planner.identification.identifiable_parameters import parameters_of_groups
from planner.identification.stages import FitContext
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.search_context import SearchContext
from planner.tracing.state import LARGEST_MASS_PRIOR, LINK_MASSES, FittedEffect, SearchState, link_mass_uncertainty
from tests.tracing.worlds import arm, calibrated, effect


def begun(found):
    """The state without effects, the bench and the catalogue, from a calibration that traced nothing."""
    bench = FitContext(found.run, split_run(found.run), lambda _: None, False)
    model = parameters_of_groups(found.fit.model, ("gauge", "geometry"))
    start = bench.fit_stage("geometry", model)
    entries = {e.name: e for e in catalogue(model.setup, found.run.samples)}
    return SearchState(model, (), start), bench, entries


def test_a_wave_that_is_still_on_its_way_keeps_the_uncertainty_of_its_frequency(monkeypatch):
    """The rounds may end before the frequency rests: it is a parameter of the fit all the same."""
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    start, bench, entries = begun(found)
    ripple = entries["gear ripple, joint 3"]
    for rounds in (2, 3, 4, 5):
        monkeypatch.setattr(states, "SETTLING_ROUNDS", rounds)
        after = start.refit(bench, (FittedEffect(ripple, 9.2),))
        assert after.effects[0].sensitivity_name in after.fit.model.names
        assert after.effects[0].value == pytest.approx(9.37, abs=0.12)


def test_weights_that_would_be_far_off_are_left_out(monkeypatch):
    """What is missing yet may look like wrong weights; with them, compliances run off to nothing."""
    size = 2e-3 / arm().reference_torque(2)
    found = calibrated(tuple(effect("joint-compliance", j, size) for j in (2, 3)), traced=False, seed=6)
    start, bench, entries = begun(found)
    soft = tuple(FittedEffect(entries[f"joint compliance, joint {j}"], None) for j in (2, 3))
    plausible = start.refit(bench, soft)
    assert 0.05 < link_mass_uncertainty(plausible.fit.model) < LARGEST_MASS_PRIOR
    monkeypatch.setattr(states, "LARGEST_MASS_PRIOR", 0.05)
    bare = start.refit(bench, soft)
    assert any(p.group == LINK_MASSES for p in plausible.fit.model.parameters)
    assert not any(p.group == LINK_MASSES for p in bare.fit.model.parameters)
    for s in (plausible, bare):
        assert [float(s.sizes(h)[0]) for h in soft] == pytest.approx([size, size], rel=0.25)


def test_a_search_keeps_nothing_of_what_models_before_were_computed_by():
    """Basis functions of models that were tried go once another state is looked at, and come out the same again."""
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    start, bench, entries = begun(found)
    context = SearchContext((), EffectDictionary(start.fit.problem.context, (), (), {}, 0), bench, lambda _: None)
    context.score_test(start)
    left, after = (start.refit(bench, (FittedEffect(entries[f"gear ripple, joint {k}"], 9.37),)) for k in (2, 3))
    wave, piece = left.fit.model.parameters[left.positions(left.effects[0])[0]].main_move.phi, after.piece
    assert wave in start.fit.problem.context._known
    context.score_test(after)
    assert wave not in start.fit.problem.context._known
    assert start.fit.problem.memory.linear is None
    assert (after.piece.columns == piece.columns).all()
