"""Gears that err in no single period, and arms that warm up in two ways: made by a world that knows neither curve."""

import numpy as np
import pytest

from planner.effects.context import Context
from tests.simulation.generator.catalogue import motions
from tests.tracing.worlds import calibrated, effect, names, run


@pytest.mark.slow
def test_an_uneven_gear_is_one_finding_and_not_ripple_upon_ripple():
    found = calibrated((effect("gear-uneven", 3, 2e-4, knots=30.0, seed=5.0),), build="tracker", size=400)
    assert names(found) == ["gear error curve, joint 3"]
    assert "mostly repeating" in found.findings[0].note
    geometry = next(s for s in found.stages if s.name == "geometry")
    noise = found.fit.problem.whitener.covariance()
    floor = np.sqrt(np.einsum("nii->n", noise).mean())
    assert found.stages[-1].held_out.rms < 0.5 * geometry.held_out.rms
    assert found.stages[-1].held_out.rms < 1.15 * floor


@pytest.mark.slow
def test_the_curve_is_the_one_that_was_planted():
    """Up to what geometry takes: an offset of the joint, and once a turn."""
    planted = effect("gear-uneven", 2, 3e-4, knots=24.0, seed=1.0)
    found = calibrated((planted,), build="tracker", size=400)
    fit = found.fit
    q = np.asarray(found.run.samples.q[:, 1])
    curve = np.zeros(len(q))
    for p, value in zip(fit.model.parameters, fit.errors, strict=True):
        if p.group == "gear error curve, joint 2":
            wave = np.sin if p.name.rsplit("_", 1)[1].startswith("sin") else np.cos
            curve += value * wave(p.main_move.phi.frequency * q)
    made = run((planted,), build="tracker", size=400)
    truth = motions(made.scene, made.truth.effects)["theta2"][made.rows]
    taken = np.column_stack([np.ones(len(q)), np.sin(q), np.cos(q), q])
    left = truth - taken @ np.linalg.lstsq(taken, truth)[0]
    shown = curve - taken @ np.linalg.lstsq(taken, curve)[0]
    sense = np.sign(left @ shown)
    assert np.sqrt(np.mean((left - sense * shown) ** 2)) < 0.2 * np.sqrt(np.mean(left**2))


@pytest.mark.slow
def test_functions_side_by_side_move_the_arm_as_one_by_one():
    """A curve's waves stand side by side once the model was linearised; before, and of a model alone, each is added."""
    found = calibrated((effect("gear-uneven", 3, 2e-4, knots=30.0, seed=5.0),), build="tracker", size=400)
    problem, errors = found.fit.problem, found.fit.errors.copy()
    errors[::7] = 0.0
    model, context = found.fit.model, Context(problem.model.setup, problem.samples)
    one_by_one = model.residual_in(context, problem.targets, errors)
    shared = model.linearize_in(context, problem.targets, errors).columns.phi
    assert shared
    again = model.linearize_in(context, problem.targets, errors)
    assert all(a is b for a, b in zip(shared, again.columns.phi, strict=True))
    assert again.residual == pytest.approx(one_by_one, abs=1e-14)
    context.forget_values()
    assert model.linearize_in(context, problem.targets, errors).columns.phi[0] is not shared[0]


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 4])
def test_gears_that_all_run_unevenly_are_found_together_where_no_single_one_shows(seed):
    """Five gears in 140 lengths: each error is small beside the sum of the others."""
    knots = {1: 17.0, 2: 15.0, 3: 19.0, 4: 14.0, 5: 16.0}
    planted = tuple(effect("gear-uneven", j, 2.5e-4, knots=k, seed=float(j + seed)) for j, k in knots.items())
    found = calibrated(planted, seed=seed, size=140)
    assert {f"gear error curve, joint {j}" for j in knots} <= set(names(found))
    geometry = next(s for s in found.stages if s.name == "geometry")
    assert found.stages[-1].held_out.rms < 0.25 * geometry.held_out.rms
    for f in found.findings:  # each for itself, though they came in together
        assert f.gain > 0
    assert len({f.gain for f in found.findings}) == len(found.findings)


@pytest.mark.slow
def test_a_pure_tone_stays_a_tone():
    found = calibrated((effect("reducer-ripple", 3, 2e-4, frequency=9.37, phase=1.0),), seed=4)
    assert names(found) == ["gear ripple, joint 3"]
    f = found.findings[0]
    assert abs(f.inner.value - 9.37) < 4 * f.inner.std


@pytest.mark.long
def test_two_warm_ups_are_found_where_one_alone_would_not_be_believed():
    planted = effect("warm-up-two", 2, 2.2e-4, back=0.66, fast=300.0, slow=3200.0)
    right = 0
    for seed in (2, 4, 6):
        found = calibrated((planted,), seed=seed, size=300)
        right += names(found) == ["warm-up, joint 2"] * 2
        fast, slow = sorted(f.inner.value for f in found.findings)
        assert 200 < fast < 450
        assert 1500 < slow < 6400
    assert right >= 2


@pytest.mark.long
@pytest.mark.parametrize(("seed", "share"), [(2, 3.0), (4, 1.5)])
def test_what_has_no_name_is_described_and_taken_out(seed, share):
    """Hoses that pull at one joint by another's angle: no entry of the catalogue does that."""
    found = calibrated((effect("hose-drag", 2, share=share, by=4.0, knots=6.0, seed=7.0),), seed=seed)
    assert names(found) == ["unnamed, joint 2 by joint 4"]
    assert "no name" in found.findings[0].note
    geometry = next(s for s in found.stages if s.name == "geometry")
    assert found.stages[-1].held_out.rms < 0.75 * geometry.held_out.rms
