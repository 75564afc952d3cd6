"""The model with its effects: inner numbers on the way, and weights that must not stand in for what they load."""

from dataclasses import replace

import numpy as np
import pytest

import planner.tracing.state as states
from planner.effects.catalogue import catalogue
from planner.effects.compliance import LINK_MASSES
from planner.effects.effect import Role
from planner.effects.sizes import LINK_MASS
from planner.fit.cross_validation import split_run
from planner.fit.identifiable_parameters import parameters_of_groups
from planner.inference.posterior_background import background_families
from planner.inference.posterior_fit import draw_posterior
from planner.inference.stages import FitContext
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.search_context import SearchContext
from planner.tracing.state import FittedEffect, SearchState, link_mass_uncertainty
from tests.tracing.worlds import arm, calibrated, effect


def begun(found):
    """The state without effects, the bench and the catalogue, from a calibration that traced nothing."""
    bench = FitContext(found.run, split_run(found.run), lambda _: None)
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


@pytest.mark.slow
def test_weights_that_would_be_far_off_are_left_out(monkeypatch):
    """What is missing yet may look like wrong weights; with them, compliances run off to nothing."""
    size = 2e-3 / arm().reference_torque(2)
    found = calibrated(tuple(effect("joint-compliance", j, size) for j in (2, 3)), traced=False, seed=6)
    start, bench, entries = begun(found)
    soft = tuple(FittedEffect(entries[f"joint compliance, joint {j}"], None) for j in (2, 3))
    plausible = start.refit(bench, soft)
    assert 0.05 < link_mass_uncertainty(plausible.fit.model) < LINK_MASS.largest
    monkeypatch.setattr(states, "LINK_MASS", replace(LINK_MASS, largest=0.05))
    bare = start.refit(bench, soft)
    assert any(p.group == LINK_MASSES for p in plausible.fit.model.parameters)
    assert not any(p.group == LINK_MASSES for p in bare.fit.model.parameters)
    for s in (plausible, bare):
        assert [float(s.sizes(h)[0]) for h in soft] == pytest.approx([size, size], rel=0.25)


@pytest.mark.slow
def test_the_posterior_takes_masses_as_large_as_usual_whatever_the_fit_has_made_of_them():
    """Size that is learnt lets them stand for compliances; it is the compliances whose size the run decides."""
    size = 2e-3 / arm().reference_torque(2)
    found = calibrated(tuple(effect("joint-compliance", j, size) for j in (2, 3)), traced=False, seed=6)
    start, bench, entries = begun(found)
    after = start.refit(bench, tuple(FittedEffect(entries[f"joint compliance, joint {j}"], None) for j in (2, 3)))
    model = after.fit.model
    wide = np.where([p.group == LINK_MASSES for p in model.parameters], 1.9, 1.0)
    learnt = replace(after.fit, problem=after.fit.problem.with_model(model.with_prior(model.prior * wide)))
    background = background_families(found.fit.setup, found.run.samples)
    drawn = draw_posterior(learnt, found.run, start.fit.model, background, sweeps=6)
    masses = [k for k, p in enumerate(drawn.problem.model.parameters) if p.group == LINK_MASSES]
    assert len(masses) == np.count_nonzero(wide > 1.0) > 0
    assert drawn.mixture.size[:, masses] * drawn.problem.model.prior[masses] == pytest.approx(LINK_MASS.usual)
    chances = {f.name: f.probability for f in drawn.families}
    assert LINK_MASSES not in chances
    assert min(chances[f"joint compliance, joint {j}"] for j in (2, 3)) > 0.5


def test_a_search_keeps_nothing_of_what_models_before_were_computed_by():
    """Basis functions of models that were tried go once another state is looked at, and come out the same again."""
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    start, bench, entries = begun(found)
    context = SearchContext((), EffectDictionary(start.fit.problem.context, (), (), {}, 0), bench, lambda _: None)
    context.score_test(start)
    left, after = (start.refit(bench, (FittedEffect(entries[f"gear ripple, joint {k}"], 9.37),)) for k in (2, 3))
    wave, piece = left.fit.model.parameters[left.positions(left.effects[0])[0]].main_move.phi, after.white_columns
    assert wave in start.fit.problem.context._known
    context.score_test(after)
    assert wave not in start.fit.problem.context._known
    assert start.fit.problem.memory.linear is None
    assert (after.white_columns.columns == piece.columns).all()


def test_a_joint_gives_way_by_one_measure_of_its_load():
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    _, _, entries = begun(found)
    compliance = entries["joint compliance, joint 2"]
    drive = replace(compliance, kind="compliance under drive torque")
    payload = replace(compliance, kind="payload compliance")
    for there in (compliance, drive, payload):
        for other in (compliance, drive, payload):
            assert not states.may_join(other, (FittedEffect(there),))
    assert states.may_join(drive, (FittedEffect(entries["joint compliance, joint 3"]),))
    assert states.may_join(entries["gear ripple, joint 2"], (FittedEffect(compliance),))


def test_each_measure_of_a_load_is_known_as_one():
    """Computed, of the drive, of the payload: a run with all three offers each as what makes a joint yield."""
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4)
    n, rng = len(found.run.samples), np.random.default_rng(0)
    more = replace(
        found.run.samples, torque=rng.normal(size=(n, len(found.run.samples.q[0]))), payload=rng.uniform(0, 5, n)
    )
    yielding = {e.kind for e in catalogue(found.fit.model.setup, more) if e.has(Role.YIELDING)}
    assert yielding == {"joint compliance", "compliance under drive torque", "payload compliance"}
