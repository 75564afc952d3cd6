"""Margins of the workspace: their meaning, and that no motion changes them by more than their bounds."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.reading import load_cell, shipped_cells
from planner.cell.workspace import STAGES, Workspace, axis_reach, parallel_transport
from planner.design.candidates.pool import draw_candidates
from planner.kinematics.chain import Chain
from planner.motion.path.margins import WorkspaceBounds
from tests.shipped import cells_that

DRAWN = cells_that(lambda cell: not cell.gauge.at_balls)
FIRST = {n.partition("/")[2]: n for n in reversed(DRAWN)}.values()  # of each gauge


def bounds_of(workspace, q, dq):
    """What each margin can lose on the motions dq (n, N) [rad] from q."""
    bounds = WorkspaceBounds(workspace)
    return bounds.changes(dq[:, None], bounds.travel(q, dq[:, None])[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", [n if n in FIRST else pytest.param(n, marks=pytest.mark.long) for n in DRAWN])
def test_no_margin_of_a_short_motion_changes_by_more_than_its_bound(name):
    cell = load_cell(name)
    workspace = Workspace(cell)
    q = draw_candidates(cell, 600).q
    rng = np.random.default_rng(0)
    dq = rng.normal(size=q.shape) * 1e-5
    dq[: len(q) // 2] *= rng.integers(0, 2, (len(q) // 2, q.shape[1]))  # single joints alone too
    change = np.abs(workspace.margins(q + dq) - workspace.margins(q))
    assert (change <= bounds_of(workspace, q, dq) * (1 + 1e-6) + 1e-12).all()


@pytest.mark.parametrize("name", DRAWN)
def test_columns_name_the_margins(name):
    for bar in (True, False):
        workspace = Workspace(load_cell(name), bar=bar)
        assert workspace.margins(workspace.cell.home[None]).shape == (1, len(workspace.columns))
        there = np.tile(workspace.cell.home, (2, 1))
        assert bounds_of(workspace, there, np.zeros_like(there)).shape == (2, len(workspace.columns))


def test_stages_are_filters_in_order():
    cell = load_cell("comau-nj130/edbb")
    workspace = Workspace(cell)
    q = draw_candidates(cell, 300).q
    assert all((workspace.stage(s, q) > 0).all() for s in STAGES)
    around = q + np.random.default_rng(0).normal(scale=0.2, size=q.shape)
    assert np.array_equal(workspace.keeps_margin(around, 0.01), (workspace.margins(around) > 0.01).all(axis=1))
    far = q.copy()
    far[:, 0] += np.pi
    assert not (workspace.stage("workspace", far) > 0).all(axis=1).any()


@pytest.mark.parametrize("name", shipped_cells())
def test_axis_reach_bounds_every_lever(name):
    """The lever of the MAP about each joint's axis, found by finite differences over random states."""
    cell = load_cell(name)
    robot = cell.robot
    q = np.random.default_rng(1).uniform(robot.q_lower, robot.q_upper, (3000, robot.n_joints))
    bound = axis_reach(cell.chain.transforms, robot.n_joints)
    h = 1e-6
    for j in range(robot.n_joints):
        step = np.zeros(robot.n_joints)
        step[j] = h
        lever = np.linalg.norm(cell.map_position(q + step) - cell.map_position(q - step), axis=1) / (2 * h)
        assert lever.max() <= bound[j] * (1 + 1e-6)
        assert lever.max() > 0.3 * bound[j]  # a bound that says nothing would slow every check


def test_axis_reach_of_random_chains():
    from planner.kinematics.chain import Transform

    rng = np.random.default_rng(7)
    for _ in range(30):
        parts, joint = [], 0
        for k in range(12):
            kind = rng.integers(3)
            axis = int(rng.integers(3))
            if kind == 0:
                parts.append(Transform(f"t{k}", "translation", axis, float(rng.normal())))
            elif kind == 1:
                parts.append(
                    Transform(f"r{k}", "rotation", axis, float(rng.choice([np.pi / 2, -np.pi / 2, np.pi, 0.3])))
                )
            else:
                parts.append(Transform(f"j{k}", "rotation", axis, 0.0, joint))
                joint += 1
        theta = rng.uniform(-np.pi, np.pi, (500, max(joint, 1)))
        motion = Chain(tuple(parts)).forward(theta)
        bound = axis_reach(parts, max(joint, 1))
        screws = np.linalg.norm(motion.point_screws(), axis=1)
        for k, t in enumerate(parts):
            if t.joint is not None:
                assert screws[k].max() <= bound[t.joint] + 1e-9


def test_spin_is_the_turn_of_the_tool_about_the_bar():
    """Turning only the flange, with the MAP on its axis and the bar along it, twists the bar by just that angle."""
    a = np.array([[0.0, 0.0, 1.0]])
    b = Rotation.from_euler("xyz", [0.4, -0.9, 0.2]).apply(a)
    turn = Rotation.from_rotvec(np.cross(a, b)[0] / np.linalg.norm(np.cross(a, b)) * np.arccos((a @ b.T).item()))
    v = np.array([[0.3, -0.5, 0.8]])
    np.testing.assert_allclose(parallel_transport(v, a, b), turn.apply(v), atol=1e-12)


def test_spin_counts_the_last_axis_where_the_bar_lies_along_it():
    cell = load_cell("kuka-kr6-r700/edbb")
    workspace = Workspace(cell)
    q = draw_candidates(cell, 4000).q
    tilt = cell.gauge.cone_map - workspace.stage("cones", q)[:, 1]
    straight = q[np.argsort(tilt)[:20]]
    turned = straight.copy()
    turned[:, 5] += 0.1
    change = np.abs(workspace.spin(turned) - workspace.spin(straight))
    change = np.minimum(change, 2 * np.pi - change)
    np.testing.assert_allclose(change, 0.1, rtol=0.1)
