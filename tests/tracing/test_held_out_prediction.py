"""Held-out samples by a further effect without a refit: as by all rows, and near what a refit gains."""

from dataclasses import replace

import numpy as np
import pytest

import planner.identification.least_squares as least_squares
import planner.tracing.held_out_prediction as prediction
from planner.identification.cross_validation import predict_held_out
from planner.tracing.assumptions import LEAST_GAIN
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.held_out_prediction import HeldOutPredictor
from planner.tracing.search_context import SearchContext
from planner.tracing.significance import held_out_gain
from planner.tracing.state import FittedEffect
from tests.tracing.test_state import begun
from tests.tracing.worlds import calibrated, effect


@pytest.fixture(scope="module")
def states():
    """The geometry's fit to an arm whose gear of joint 3 ripples, what fits it, and the catalogue."""
    return begun(calibrated((effect("reducer-ripple", 3, share=3.0, frequency=9.37, phase=1.0),), traced=False, seed=4))


def test_it_is_what_all_rows_without_the_fold_give(states, monkeypatch):
    """The step of every fold once more by least squares of the whitened rows, with the prior's below them."""
    monkeypatch.setattr(prediction, "prior_factors", lambda model, *_: np.ones(len(model.parameters)))
    state, bench, entries = states
    parameters = entries["gear ripple, joint 3"].make(9.2)
    predicted = HeldOutPredictor.of(state.fit, bench.split).residual_with(parameters)
    problem = state.fit.problem.with_model(state.fit.model.plus(list(parameters)))
    errors = np.append(state.fit.errors, np.zeros(len(parameters)))
    piece, raw = problem.piece(slice(None), errors), problem.residual(errors)
    rows = problem.model.linearize_in(problem.context, problem.targets, errors).rows
    for f in range(bench.split.folds):
        train, own = bench.split.fold != f, bench.split.fold == f
        J = np.vstack([piece.rows[train].reshape(-1, len(errors)), np.eye(len(errors))])
        e = np.append(piece.residual[train].ravel(), -errors / problem.prior)
        step = problem.prior * np.linalg.lstsq(J, e)[0]
        assert predicted[own] == pytest.approx(raw[own] - rows[own] @ step, abs=1e-9)


def test_what_only_one_fold_knows_is_predicted_too(states):
    """There the bordered information of every fold is solved as a whole; elsewhere it gives the same."""
    state, bench, entries = states
    parameters = entries["gear ripple, joint 3"].make(9.2)
    quick, whole = (HeldOutPredictor.of(state.fit, bench.split) for _ in range(2))
    whole.__dict__["_fold_factors"] = None
    assert quick.residual_with(parameters) == pytest.approx(whole.residual_with(parameters), abs=1e-11)


def test_a_refit_gains_what_was_predicted(states):
    """Of what is there, and of what is not, which is then known to be worth no refit."""
    state, bench, entries = states
    context = SearchContext((), EffectDictionary(state.fit.problem.context, (), (), {}, 0), bench, lambda _: None)
    there = FittedEffect(entries["gear ripple, joint 3"], 9.37)
    gain, error = held_out_gain(state, state.refit(bench, (there,)), bench)
    predicted = context.predict_gain(state, there)
    assert predicted is not None
    assert predicted[0] == pytest.approx(gain, abs=0.2 * gain)
    assert gain > max(error, LEAST_GAIN)
    fitted = state.refit(bench, (there,))
    faint = 0
    for e in (entries[name] for name in ("backlash, joint 2", "hysteresis, joint 4", "soft base, base")):
        other = FittedEffect(e, e.grid[len(e.grid) // 2])
        fall, error = context.predict_gain(fitted, other)
        gain, own = held_out_gain(fitted, fitted.refit(bench, (*fitted.effects, other)), bench)
        if 2 * fall < max(error, LEAST_GAIN):
            faint += 1
            assert gain < max(own, LEAST_GAIN), e.name
    assert faint


def test_where_more_is_judged_than_is_fitted_nothing_is_predicted(states):
    """Then a refit has to tell."""
    state, bench, entries = states
    context = SearchContext((), EffectDictionary(state.fit.problem.context, (), (), {}, 0), bench, lambda _: None)
    few = replace(state.fit, problem=state.fit.problem.take(np.arange(50)))
    part = replace(state, fitted=replace(state.fitted, fit=few))
    assert context.predict_gain(part, FittedEffect(entries["backlash, joint 2"])) is None


def test_the_columns_that_a_fit_ended_with_predict_as_new_ones(states, monkeypatch):
    """What the last step changed in them does not show."""
    monkeypatch.setattr(least_squares, "FROZEN_NUMBERS", 0)
    state, bench, _ = states
    stage = bench.fit_stage("geometry", state.fit.model)
    assert stage.fit.problem.memory.folds is None
    again = predict_held_out(stage.fit, bench.split).residual
    assert stage.stage.held_residual == pytest.approx(again, abs=1e-3 * stage.stage.held_out.rms)
