"""What a prompt shows of an object is one line that names it, not its arrays."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from planner.cell.reading import load_cell
from planner.common.result import Plot
from planner.workflow.plan_use import simulate
from tests.workflow.small_plan import write_small_plan


@pytest.mark.slow
def test_results_runs_and_robots_show_themselves_in_one_line(tmp_path):
    write_small_plan(tmp_path, "kuka-kr6-r700/edbb", 2)
    made = simulate(tmp_path / "plan.json", seed=1)
    run, robot = made.run, load_cell("kuka-kr6-r700/edbb").robot
    assert repr(made) == f"<SimulationResult: {made.summary().splitlines()[0].strip()}>"
    said = f"'{run.name}', samples={len(run)}, plan_id='{run.plan_id}', simulated={run.simulated}"
    assert repr(run) == f"SimulatedRun({said})"
    assert repr(robot) == f"Robot('kuka-kr6-r700', joints=6, path='{robot.path}')"
    for shown in (made, run, robot, Plot("errors", np.zeros(9999).tobytes(), Figure)):
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 300
