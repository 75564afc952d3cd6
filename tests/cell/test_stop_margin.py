"""What a plan keeps from a bar's ends: how far off an arm that is not calibrated yet may be."""

import numpy as np
import pytest

from planner.cell.reading import load_cell


@pytest.mark.parametrize("name", ["kuka-kr6-r700/edbb", "comau-nj130/edbb"])
def test_the_margin_is_twice_the_scatter_of_drawn_robots(name):
    """Fixture, tool point and 3000 arms with errors drawn from their priors, along any direction."""
    cell = load_cell(name)
    robot, rng, p_FM = cell.robot, np.random.default_rng(0), cell.tool.points[0].p_FM
    length, angle = robot.priors.length, robot.priors.angle
    size = np.array([0 if t.fixed else length if t.kind == "translation" else angle for t in robot.transforms])
    theta = robot.theta(np.repeat(cell.home[None], 3000, axis=0))
    stand = robot.chain.forward(theta, list(rng.normal(size=(len(size), 3000)) * size[:, None]))
    arm = np.var(stand.x + np.einsum("ijn,j->in", stand.R, p_FM), axis=1).mean()
    off = np.sqrt(arm + cell.fixtures[0].prior ** 2 + cell.tool.prior**2)
    assert cell.gauge.stop_margin == pytest.approx(2 * off, rel=0.03)
