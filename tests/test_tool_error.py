"""The error that a calibrated robot's tool would keep: against drawn robots, measured and aligned one by one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.parts import ToolPoint
from planner.cell.reading import load_cell
from planner.model.tool_error import ToolError, uniform_states
from tests.simulation.generator.arm import Arm

DRAWN = 300


@pytest.fixture(scope="module")
def cell():
    return load_cell("kuka-kr6-r700/edbb")


@pytest.mark.long
def test_it_is_the_error_of_drawn_robots_after_the_best_alignment(cell):
    """Robots with drawn errors, their tools' true positions laid on the nominal ones as well as can be (Kabsch)."""
    names, size = ("a1", "alpha2", "d4", "theta3", "map_x"), np.array([3e-5, 1e-4, 5e-5, 8e-5, 4e-5])
    workspace = ToolError.of(replace(cell, base=replace(cell.base, floor=None)))
    arm, rng = Arm.from_toml("kuka-kr6-r700"), np.random.default_rng(5)
    q = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (2000, 6))
    square = 0.0
    for drawn in rng.standard_normal((DRAWN, len(names))) * size:
        R, p = arm.flange(q, dict(zip(names[:-1], drawn[:-1], strict=True)))
        x = p + R @ (cell.tool.p_FM + np.array([drawn[-1], 0, 0]))
        R, p = arm.flange(q)
        square += (aligned(x, p + R @ cell.tool.p_FM) ** 2).sum(axis=1).mean() / DRAWN
    assert workspace.rms(names, np.diag(size**2)) == pytest.approx(np.sqrt(square), rel=0.1)


def test_the_workspace_is_what_the_glossary_says():
    """Limits, a turn about home, the floor, by the arm's own chain; and no word of collisions that would not hold."""
    cell = load_cell("comau-nj130/edbb")
    wide = replace(cell.robot, q_lower=cell.robot.q_lower - 20, q_upper=cell.robot.q_upper + 20)
    for robot in (cell.robot, wide):
        there = replace(cell, robot=robot)
        q = uniform_states(there, 3000, 0)
        assert (q >= robot.q_lower).all()
        assert (q <= robot.q_upper).all()
        assert (np.ptp(q, axis=0) <= 2 * np.pi).all()
        R, p = Arm.from_toml("comau-nj130").flange(q)
        assert (p + R @ cell.tool.p_FM)[:, 2].min() > cell.base.floor
    glossary = (Path(__file__).parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8")
    said = "all poses within the joints' limits, with the tool above the floor, collisions or not; a joint of over 360°"
    assert f'<a id="workspace"></a>workspace | {said} within half a turn of home |' in glossary


def test_how_the_base_stands_does_not_count(cell):
    workspace = ToolError.of(cell)
    assert workspace.rms(("theta1", "d1"), np.diag([1e-3, 1e-3]) ** 2) < 1e-9


def test_a_second_tool_point_does_not_change_what_the_first_one_does(cell):
    """The names are then those of the point, and the tool's own place counts as before."""
    points = tuple(ToolPoint(n, cell.tool.p_FM + d, cell.tool.axis_F) for n, d in (("1", 0.0), ("2", 0.05)))
    two = replace(cell, tool=replace(cell.tool, points=points))
    alone, both = ToolError.of(cell), ToolError.of(two)
    assert [n.replace("map_1_", "map_") for n in both.names] == list(alone.names)
    assert np.allclose(both.square, alone.square)


def aligned(x, y):
    turn, _ = Rotation.align_vectors(y - y.mean(axis=0), x - x.mean(axis=0))
    return turn.apply(x - x.mean(axis=0)) - (y - y.mean(axis=0))
