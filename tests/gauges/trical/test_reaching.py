"""The inverse kinematics against pinocchio's forward pass and against a root finder from everywhere."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from planner.kinematics.inverse_kinematics import retract_tool, solve_point_ik
from planner.kinematics.robot_reader import load_robot


def test_every_posture_that_a_root_finder_knows_is_found(cell, tool_pose):
    ball, wrist = cell.p_BS[2], np.deg2rad([20.0, 60.0, -35.0])
    low, up = cell.robot.q_lower, cell.robot.q_upper
    rng = np.random.default_rng(1)
    starts = rng.uniform(low[:3], up[:3], (300, 3))
    known = set()
    for start in starts[:120]:
        x, _, ok, _ = fsolve(lambda v: tool_pose([*v, *wrist])[0] - ball, start, full_output=True)
        if ok == 1:
            known.add(tuple(np.round((x + np.pi) % (2 * np.pi), 5) % round(2 * np.pi, 5)))
    starts = np.hstack([starts, np.tile(wrist, (300, 1))])
    found, off = solve_point_ik(cell.chain, cell.robot, starts, ball)
    on = found[off < 1e-9][:, :3]
    mine = {tuple(np.round((x + np.pi) % (2 * np.pi), 5) % round(2 * np.pi, 5)) for x in on}
    assert len(known) >= 4
    assert all(min(np.abs(np.subtract(k, m)).max() for m in mine) < 1e-4 for k in known)
    for q in found[off < 1e-9][:20]:
        assert np.linalg.norm(tool_pose(q)[0] - ball) < 1e-8


def test_the_tool_withdraws_along_its_own_axis(cell, pool, tool_pose):
    back, off = retract_tool(cell.chain, cell.robot, pool.q[:60], 0.04 * cell.tool.axis_F)
    done = off < 1e-8
    assert done.all()
    for q, away in zip(pool.q[:60], back, strict=True):
        (p, R), (p_back, R_back) = tool_pose(q), tool_pose(away)
        assert np.allclose(p_back, p - 0.04 * R @ cell.tool.axis_F, atol=1e-7)
        assert np.allclose(R_back, R, atol=1e-6)


def test_out_of_reach_the_nearest_miss_is_told(cell):
    far = np.array([1.5, 0.0, 0.4])
    rng = np.random.default_rng(0)
    q = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (4000, 6))
    _, off = solve_point_ik(cell.chain, cell.robot, q, far)
    blind = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (400_000, 6))
    nearest = np.linalg.norm(cell.map_position(blind) - far, axis=1)
    assert off.min() < nearest.min() + 1e-3
    assert off.min() > nearest.min() - 0.03


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
def test_arms_whose_first_axes_meet_in_a_shoulder_reach_a_point_by_others(name):
    robot = load_robot(name)
    rng = np.random.default_rng(2)
    states = rng.uniform(robot.q_lower, robot.q_upper, (400, robot.n_joints))
    there = robot.chain.forward(robot.theta(states[:1])).x[:, 0]
    q, off = solve_point_ik(robot.chain, robot, states[1:], there)
    on = off < 1e-9
    assert on.mean() > 0.2
    reached = robot.chain.forward(robot.theta(q[on])).x.T
    assert np.abs(reached - there).max() < 1e-8
    assert len(np.unique(np.round(q[on], 6), axis=0)) == on.sum()
