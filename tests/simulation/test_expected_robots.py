"""Simulated robots are those that a plan expects: as far off before it, and within what it says after it."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.cell.setup import setup_of
from planner.common.units import to_mm
from planner.design.free_parameters import undeclared_errors
from planner.gauges.frame_gauge import ToolPosition
from planner.instruments.simulation import simulate_run
from planner.instruments.truth import Truth, draw_expected_truth, read_truth
from planner.model.tool_error import tool_setup, uniform_states
from planner.runs.run import Samples
from planner.workflow.plan_results import SimulationResult

CELLS = ["comau-nj130/edbb", "kuka-kr6-r700/edbb", "abb-irb6700/edbb", "ur10/edbb", "ur5e/edbb"]


def tool_errors(cell, truth, believed=None, states=400):
    """Rms of the tool's error [m] over the workspace, the base aligned anew, by forward kinematics alone."""
    q = uniform_states(cell, states, 7)
    samples = Samples.at(q)
    model, errors = truth.complete_model()
    own = [k for k, p in enumerate(model.parameters) if not p.name.startswith(("fixture", "zero"))]
    bench = tool_setup(replace(setup_of(cell)), cell.tool.p_FM)
    tool = replace(model.subset(own), setup=replace(model.setup, gauge=ToolPosition(noise=0.0), p_BX=bench.p_BX))
    aim = tool.reading(samples) if believed is None else believed(q)
    off = (tool.reading(samples, errors[own]) - aim).ravel()
    p = aim - aim.mean(axis=0)
    turns = np.stack([np.cross(axis, p) for axis in np.eye(3)], axis=2).reshape(-1, 3)
    base = np.hstack([np.tile(np.eye(3), (len(p), 1)), turns])
    left = off - base @ np.linalg.lstsq(base, off, rcond=None)[0]
    return float(np.sqrt((left**2).sum() / len(p)))


@pytest.mark.parametrize("name", CELLS[:3])
def test_robots_are_as_far_off_as_the_plan_says_before_it(name):
    cell = load_cell(name)
    samples = Samples.at(uniform_states(cell, 50, 0))
    unknown = undeclared_errors(cell, samples)
    said = unknown.state(float(np.trace(unknown.weight_per_prior)))
    drawn = [tool_errors(cell, draw_expected_truth(cell, seed), states=150) for seed in range(60)]
    assert np.sqrt(np.mean(np.square(drawn))) == pytest.approx(said, rel=0.15)


def test_the_gears_of_a_drawn_robot_are_read_back_from_its_run(tmp_path):
    cell = load_cell("kuka-kr6-r700/edbb")
    samples = Samples.at(uniform_states(cell, 20, 3))
    truth = draw_expected_truth(cell, 4, samples)
    run = simulate_run(cell, "plan", samples, truth, 4)
    SimulationResult(run).write(tmp_path / "run.csv")
    again = read_truth(tmp_path / "run.csv", cell, samples)
    assert isinstance(again, Truth)
    assert len(truth.effects) > cell.robot.n_joints
    (model, errors), (same, values) = truth.complete_model(), again.complete_model()
    assert same.names == model.names
    assert np.allclose(errors, values, rtol=0, atol=1e-12)
    assert to_mm(tool_errors(cell, truth)) > 0.1
