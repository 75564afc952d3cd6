"""What a plan can see of an arm is what the identification of its run fits."""

from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.fit.identifiable_parameters import choose_parameters
from planner.fit.run_setup import setup_for_run
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_truth
from tests.not_everywhere import require_planning


def test_an_arm_by_urdf_with_a_bar_has_its_joint_zeros_fitted_that_the_plan_kept() -> None:
    require_planning()
    cell = load_cell(str(Path(__file__).parents[2] / "examples" / "own_urdf.toml"))
    pool = draw_candidates(cell, 3000)
    planned, _, _ = identify_candidates(cell, pool)
    few = pool.samples.take(np.arange(0, len(pool), 10))
    run = simulate_run(cell, "0123456789ab", few, draw_truth(cell, 0), 0)
    fitted = choose_parameters(cell, setup_for_run(cell, run), run).model
    assert set(fitted.names) == set(planned.names)
    assert {f"theta{k}" for k in (2, 3, 4, 5)} <= set(fitted.names)
