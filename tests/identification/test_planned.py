"""The covariance that a plan predicts and the one that the fit of its run finds: one model, one noise."""

from functools import cache

import numpy as np
import pytest
from scipy import stats

from planner.candidates import Funnel, PoseSet
from planner.cell import load_cell
from planner.choice import choose
from planner.identification import Problem, fit
from planner.identification.placed import placed, rig_for
from planner.identification.seeing import seen_by
from planner.model import Model
from planner.observability import covariance
from planner.run import Readings, Run, Samples
from tests.generator.poses import at_targets, shell_points
from tests.generator.truth import Noise, draw_errors
from tests.identification.worlds import World, arm_of

CELLS = ("comau-nj130/edbb", "ur10/edbb")
POSES, FITS = 60, 150


@cache
def planned(reference):
    """The cell, the poses that planning chooses from a pool of its own, and the world in which they are measured."""
    cell = load_cell(reference)
    arm, rng = arm_of(cell.robot.name), np.random.default_rng(1)
    fixture, tool = cell.fixtures[0].p_BX, cell.tool.p_FM
    q = at_targets(arm, shell_points(fixture, (0.31, 0.51), 1500, rng, np.radians(75)), tool, rng)
    q = q[~np.isnan(q[:, 0])][:600]
    choice = choose(cell, PoseSet(q, np.zeros(len(q), dtype=int), Funnel()), POSES, "O2", 0)[0]
    samples = Samples(choice.q, np.zeros(POSES, dtype=int))
    run = Run("made", samples, Readings(length=np.zeros(POSES)), ("A",))
    rig = placed(rig_for(cell, run), run)
    model = seen_by(Model.of(rig, cell.plan.free), samples)[0]
    w = World(arm, choice.q, np.arange(POSES) * 20.0, fixture, tool, run, cell, model)
    return choice, w


@pytest.mark.parametrize("reference", CELLS)
def test_plan_and_fit_use_the_same_parameters(reference):
    choice, w = planned(reference)
    assert w.model.names == choice.model.names
    assert np.allclose(w.model.prior, choice.model.prior)


@pytest.mark.parametrize("reference", CELLS)
def test_plan_and_fit_have_the_same_rows_and_noise(reference):
    choice, w = planned(reference)
    assert np.allclose(w.model.rows(w.run.samples), choice.model.jacobian(choice.q, choice.fixture), atol=1e-12)
    white = Problem.of(w.model, w.run).whitener.covariance(slice(None))[:, 0, 0]
    assert np.allclose(np.sqrt(white), choice.model.noise(choice.q, choice.fixture), rtol=1e-12)


@pytest.mark.parametrize("reference", CELLS)
def test_predicted_spread_is_the_spread_of_many_fits(reference):
    """Standard deviation of the estimates over 150 arms, each parameter, within what chance allows of the prediction.

    The prediction takes no prior: what it holds back of the faintest parameters is left out by looking at one side.
    """
    choice, w = planned(reference)
    predicted = covariance(
        choice.model.jacobian(choice.q, choice.fixture), choice.model.noise(choice.q, choice.fixture)[:, None]
    )
    noise = Noise(choice.model.rig.noise, choice.model.joint_sigma)
    off, stated = [], []
    for k in range(FITS):
        rng = np.random.default_rng([8, k])
        errors = draw_errors(w.arm, rng)
        truth, left = w.regrouped(errors)
        assert np.abs(left).max() < 1e-6
        found = fit(Problem.of(w.model, w.measured(errors, noise, rng)))
        off.append(found.errors - truth)
        stated.append(np.sqrt((found.solution.root(found.problem.prior) ** 2).sum(axis=1)))
    ratio = np.sqrt((np.array(off) ** 2).mean(axis=0)) / predicted.std
    tail = 1e-3 / len(ratio) / 2
    low, high = np.sqrt(stats.chi2.ppf([tail, 1 - tail], FITS) / FITS)
    sure = predicted.std < 0.1 * choice.model.prior  # the fit's priors have no say there
    assert sure.sum() > len(ratio) / 2
    names = np.array(w.names)
    assert np.all(ratio < high), dict(zip(names[ratio >= high], ratio[ratio >= high], strict=True))
    assert np.all(ratio[sure] > low), dict(zip(names[sure], ratio[sure], strict=True))
    said = np.median(np.array(stated), axis=0) / predicted.std
    assert np.all(said < 1.05)
    assert np.all(said[sure] > 0.93)
