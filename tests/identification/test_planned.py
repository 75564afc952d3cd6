"""The covariance that a plan predicts and the one that the fit of its run finds: one model, one noise."""

from functools import cache

import numpy as np
import pytest
from scipy import stats

from planner.cell.reading import load_cell
from planner.design.candidates.pool import Funnel, PoseSet
from planner.design.observability.information import predict_covariance
from planner.design.pose_selection import identify_candidates
from planner.design.selection.index_search import exchange_poses
from planner.fit.identifiable_parameters import identifiable_subset
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, setup_for_run
from planner.model.model import Model
from planner.runs.run import Readings, Run, Samples
from tests.identification.worlds import World, arm_of
from tests.simulation.generator.poses import at_targets, shell_points
from tests.simulation.generator.truth import Noise, draw_errors

CELLS = ("comau-nj130/edbb", "ur10/edbb")
QUICK_CELLS = (CELLS[0], pytest.param(CELLS[1], marks=pytest.mark.long))
POSES, FITS = 60, 150


@cache
def planned(reference):
    """The model of the plan, and the world in which the poses that planning chooses from a pool are measured."""
    cell = load_cell(reference)
    arm, rng = arm_of(cell.robot.name), np.random.default_rng(1)
    fixture, tool = cell.fixtures[0].p_BX, cell.tool.p_FM
    q = at_targets(arm, shell_points(fixture, (0.31, 0.51), 1500, rng, np.radians(75)), tool, rng)
    q = q[~np.isnan(q[:, 0])][:600]
    model, _, rows = identify_candidates(cell, PoseSet(Samples.at(q), Funnel()))
    q = q[exchange_poses(rows, POSES, "O2", steps=3_000).chosen]
    run = Run("made", Samples(q, np.zeros(POSES, dtype=int)), Readings(length=np.zeros(POSES)), ("A",))
    setup = locate_gauge(setup_for_run(cell, run), run)
    fitted = identifiable_subset(Model.of(setup, cell.plan.free), run.samples)[0]
    return model, World(arm, q, np.arange(POSES) * 20.0, fixture, tool, run, cell, fitted)


@pytest.mark.slow
@pytest.mark.parametrize("reference", QUICK_CELLS)
def test_plan_and_fit_use_the_same_parameters(reference):
    plan, w = planned(reference)
    assert w.model.names == plan.names
    assert np.allclose(w.model.prior, plan.prior)


@pytest.mark.slow
@pytest.mark.parametrize("reference", QUICK_CELLS)
def test_plan_and_fit_have_the_same_rows_and_noise(reference):
    plan, w = planned(reference)
    assert np.allclose(w.model.rows(w.run.samples), plan.rows(Samples.at(w.q)), atol=1e-12)
    white = FitProblem.of(w.model, w.run).whitener.covariance()[:, 0, 0]
    assert np.allclose(np.sqrt(white), plan.noise(Samples.at(w.q)), rtol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("reference", CELLS)
def test_predicted_spread_is_the_spread_of_many_fits(reference):
    """Standard deviation of the estimates over 150 arms, each parameter, within what chance allows of the prediction.

    The prediction takes no prior: what it holds back of the faintest parameters is left out by looking at one side.
    """
    plan, w = planned(reference)
    predicted = predict_covariance(plan.rows(at := Samples.at(w.q)), plan.noise(at)[:, None])
    noise = Noise(plan.setup.gauge.noise, plan.joint_sigma)
    off, stated = [], []
    for k in range(FITS):
        rng = np.random.default_rng([8, k])
        errors = draw_errors(w.arm, rng)
        truth, left = w.regrouped(errors)
        assert np.abs(left).max() < 1e-6
        found = fit(FitProblem.of(w.model, w.measured(errors, noise, rng)))
        off.append(found.errors - truth)
        stated.append(np.sqrt((found.solution.root(found.problem.prior) ** 2).sum(axis=1)))
    ratio = np.sqrt((np.array(off) ** 2).mean(axis=0)) / predicted.std
    tail = 1e-3 / len(ratio) / 2
    low, high = np.sqrt(stats.chi2.ppf([tail, 1 - tail], FITS) / FITS)
    sure = predicted.std < 0.1 * plan.prior  # the fit's priors have no say there
    assert sure.sum() > len(ratio) / 2
    names = np.array(w.names)
    assert np.all(ratio < high), dict(zip(names[ratio >= high], ratio[ratio >= high], strict=True))
    assert np.all(ratio[sure] > low), dict(zip(names[sure], ratio[sure], strict=True))
    said = np.median(np.array(stated), axis=0) / predicted.std
    assert np.all(said < 1.05)
    assert np.all(said[sure] > 0.93)
