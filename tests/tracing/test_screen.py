"""Scores against refits, refined inner numbers against what was planted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f

from planner.effects.catalogue import catalogue
from planner.tracing.effect_scores import ScoreTest, log_exceedance
from tests.tracing.worlds import calibrated, effect


def cost(rows, residual, held):
    """Least sum of squares, the first ``held`` columns with priors of one."""
    hold = np.zeros((held, rows.shape[1]))
    hold[:, :held] = np.eye(held)
    A, b = np.vstack([rows, hold]), np.append(residual, np.zeros(held))
    found = np.linalg.lstsq(A, b)[0]
    return float(((b - A @ found) ** 2).sum())


@pytest.mark.parametrize(
    "kind", ["backlash", "gear ripple", "link bending", "gauge sag", "coupling", "axis wobble twice a turn", "drift"]
)
def test_the_score_is_what_a_refit_gains(kind):
    found = calibrated((effect("backlash-approach", 3, share=2.0),), traced=False)
    fit = found.fit
    shade = ScoreTest.of(fit)
    entries = [e for e in catalogue(fit.model.setup, found.run.samples) if e.kind == kind][:3]
    assert entries
    for entry in entries:
        inner = None if entry.nonlinear is None else float(entry.nonlinear.values[5])
        score = shade.score_one(entry, inner)
        P = len(fit.errors)
        wide = fit.model.plus(list(entry.make(inner)))
        piece = fit.problem.with_model(wide).white_columns(np.append(fit.errors, np.zeros(len(wide.prior) - P)))
        rows = piece.rows.reshape(-1, len(wide.prior))
        gain = cost(rows[:, :P], shade.residual, P) - cost(rows, shade.residual, P)
        assert score.gain == pytest.approx(gain, rel=0.03, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "frequency"), [(2, 7.31), pytest.param(4, 18.9, marks=pytest.mark.long)])
def test_the_frequency_of_a_ripple_comes_out_with_its_uncertainty(seed, frequency):
    found = calibrated((effect("reducer-ripple", 3, share=3.0, frequency=frequency, phase=1.0),), seed=seed)
    first = found.findings[0]
    assert (first.effect, first.on) == ("gear ripple", "joint 3")
    assert abs(first.inner.value - frequency) < 3.5 * first.inner.std
    assert 1e-4 < first.inner.std < 0.2


@pytest.mark.slow
def test_the_size_comes_out_with_its_uncertainty():
    z = []
    for seed in (2, 4):
        found = calibrated((effect("backlash-approach", 2, 8e-5),), seed=seed)
        first = found.findings[0]
        assert (first.effect, first.on) == ("backlash", "joint 2")
        z.append((abs(first.value) - 8e-5) / first.std)
    assert np.abs(z).max() < 4
    assert np.abs(z).max() > 0.05  # a stated uncertainty that is never used would be far too wide


def test_a_worse_fit_scores_lower():
    """Another residual has another gain: the score looks at the readings."""
    found = calibrated((effect("backlash-approach", 3, share=2.0),), traced=False)
    shade = ScoreTest.of(found.fit)
    entry = next(e for e in catalogue(found.fit.model.setup, found.run.samples) if e.name == "backlash, joint 3")
    real = shade.score_one(entry).gain
    rng = np.random.default_rng(1)
    noise = replace(shade, residual=rng.permutation(shade.residual))
    assert noise.score_one(entry).gain < 0.2 * real


def test_chances_are_those_of_fishers_ratio():
    ratio, size = np.array([0.0, 1e-9, 1.0, 5.0, 100.0]), np.array([1, 2, 3, 5, 8])
    dof = np.array([100.0, 3000.0, 20.5, 5000.0, 12000.0])
    assert log_exceedance(ratio, size, dof) == pytest.approx(f.logsf(ratio, size, dof), rel=1e-6, abs=1e-12)
    assert log_exceedance(np.array(1e6), 3, 1e4) == -np.inf
