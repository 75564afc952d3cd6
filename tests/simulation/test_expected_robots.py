"""Simulated robots are those that a plan expects: as far off before it, and within what it says after it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import binom

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.common.units import to_mm
from planner.design.free_parameters import undeclared_errors
from planner.gauges.frame_gauge import ToolPosition
from planner.model.tool_error import samples_like, tool_setup, uniform_states
from planner.runs.run import Samples
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_expected_truth, read_truth
from planner.workflow.identification import identify
from planner.workflow.plan_results import PlanResult, SimulationResult
from planner.workflow.plan_use import simulate
from planner.workflow.planning import plan
from tests.identification.few_draws import few_draws

CELLS = [
    "comau-nj130/edbb", "kuka-kr6-r700/edbb", "abb-irb6700/edbb", "ur10/edbb", "ur5e/edbb", "comau-nj130/paper",
    "panda/tracker", "so101/sockets",
]  # fmt: skip
POSES = {"panda/tracker": 60, "so101/sockets": 60}  # else 80
SEEDS = range(8)


def tool_positions(cell, model, errors, samples):
    """Where the tool point of a robot with such errors comes, (n, 3) [m], by forward kinematics alone."""
    own = [k for k, p in enumerate(model.parameters) if not p.name.startswith(("fixture", "zero"))]
    bench = replace(model.setup, gauge=ToolPosition(noise=0.0), p_BX=tool_setup(setup_of(cell), cell.tool.p_FM).p_BX)
    return replace(model.subset(own), setup=bench).reading(samples, errors[own])


def apart(p, aim):
    """Rms distance [m] of positions (n, 3) over the workspace, the base aligned anew."""
    off, about = (p - aim).ravel(), aim - aim.mean(axis=0)
    turns = np.stack([np.cross(axis, about) for axis in np.eye(3)], axis=2).reshape(-1, 3)
    base = np.hstack([np.tile(np.eye(3), (len(p), 1)), turns])
    left = off - base @ np.linalg.lstsq(base, off, rcond=None)[0]
    return float(np.sqrt((left**2).sum() / len(p)))


def true_error(cell, truth, fit=None, like=None, states=400):
    """Rms error of the tool over the workspace [m]: of the nominal robot, or of one fitted to the run ``like``."""
    q = uniform_states(cell, states, 7)
    samples = Samples.at(q) if like is None else samples_like(like, q)
    model, errors = truth.complete_model()
    aim = tool_positions(cell, *((model, 0 * errors) if fit is None else (fit.model, fit.errors)), samples)
    return apart(tool_positions(cell, model, errors, samples), aim)


@pytest.mark.slow
@pytest.mark.parametrize("name", [CELLS[0], pytest.param(CELLS[1], marks=pytest.mark.long)])
def test_robots_are_as_far_off_as_the_plan_says_before_it(name):
    cell = load_cell(name)
    samples = Samples.at(uniform_states(cell, 50, 0))
    unknown = undeclared_errors(cell, samples)
    said = unknown.state(float(np.trace(unknown.weight_per_prior)))
    drawn = [true_error(cell, draw_expected_truth(cell, seed, samples), states=100) for seed in range(30)]
    assert np.sqrt(np.mean(np.square(drawn))) == pytest.approx(said, rel=0.2)


def test_the_gears_of_a_drawn_robot_are_read_back_from_its_run(tmp_path):
    cell = load_cell("kuka-kr6-r700/edbb")
    samples = Samples.at(uniform_states(cell, 20, 3))
    truth = draw_expected_truth(cell, 4, samples)
    SimulationResult(simulate_run(cell, "plan", samples, truth, 4)).write(tmp_path / "run.csv")
    again = read_truth(tmp_path / "run.csv", cell, samples)
    assert len(truth.effects) > cell.robot.n_joints
    (model, errors), (same, values) = truth.complete_model(), again.complete_model()
    assert same.names == model.names
    assert np.allclose(errors, values, rtol=0, atol=1e-12)
    assert to_mm(true_error(cell, truth)) > 0.1
    few = Samples.at(uniform_states(cell, 3, 8))  # of another plan of the same robot, as a check has
    other = read_truth(tmp_path / "run.csv", cell, few)
    assert [e.values for e in other.effects] == [e.values for e in again.effects]


@cache
def trials(name):
    """How many of the robots of a cell end within what their plan said."""
    planned, within = plan(name, poses=POSES.get(name, 80)), 0
    assert isinstance(planned, PlanResult)
    forecast = planned.plan.forecast
    assert forecast is not None
    for seed in SEEDS:
        run = simulate(planned, seed=seed).run
        with few_draws():
            found = identify(run, plan=planned).calibration
        truth = draw_expected_truth(planned.plan.cell, seed, run.samples)
        within += true_error(planned.plan.cell, truth, found.released.fit, found.run) <= forecast.at_most
    return within


@pytest.mark.long
@pytest.mark.parametrize("name", CELLS)
def test_a_trial_ends_within_what_its_plan_said(name):
    assert binom.cdf(trials(name), len(SEEDS), 0.9) > 0.01, trials(name)


@pytest.mark.long
def test_trials_end_within_what_their_plans_said_in_90_of_100():
    within = [trials(name) for name in CELLS]
    assert binom.cdf(sum(within), len(SEEDS) * len(CELLS), 0.9) > 0.01, within
