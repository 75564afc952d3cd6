"""Circle against error-sensitive path: a circle uses little of the bar and shows less of the robot."""

import numpy as np
import pytest

from planner.cell.placement import Targets
from planner.circular.plan import circle_samples
from planner.design.candidates.pool import draw_candidates
from planner.reproduction.circle_and_path import compare_samples
from planner.runs.run import Samples
from planner.simulation.assumptions import CUP_SIGMA
from planner.simulation.set_up import solve_fixture_pose
from planner.simulation.simulated_run import SAMPLE_RATE
from planner.simulation.truth import draw_truth


@pytest.mark.slow
def test_a_circle_uses_and_shows_less(planned):
    poses = draw_candidates(planned.cell, 300, 0).q
    shell = Samples(q=poses, place=np.zeros(len(poses), dtype=int))
    found = compare_samples(planned.cell, circle_samples(planned, SAMPLE_RATE, ways=False), shell, range(4))
    for one in found:
        assert 0.0 < one.circle.length < 20e-3 < 150e-3 < one.path.length
        # the planned length does not change on a circle: all that the bar does there is deviation
        assert one.circle.deviation == pytest.approx(one.circle.length, abs=10e-6)
        assert one.circle.deviation < one.path.deviation < 60e-3


@pytest.mark.slow
def test_the_fixture_stands_where_the_robot_put_it(planned):
    """Driven onto its fixture again, in that very state, the robot finds the ball: the bar has no length."""
    cell = planned.cell
    truth = draw_truth(cell, 3)
    moved = truth.errors[[truth.model.names.index(f"fixture_A_{a}") for a in "xyz"]]
    assert 1e-4 < np.linalg.norm(moved) < 2e-2
    q = solve_fixture_pose(cell, cell.fixtures[0].p_BX)
    assert np.abs(cell.map_position(q)[0] - cell.fixtures[0].p_BX).max() < 1e-9
    length = -truth.model.residual(Samples(q, np.zeros(1, dtype=int)), Targets(length=np.zeros(1)), truth.errors)
    assert np.abs(length).max() < 5 * CUP_SIGMA  # the hand's care in three directions, and that of the zero
