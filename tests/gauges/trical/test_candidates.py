"""Candidates at balls: on the ball, free by the second engine, approached from outside; each filter counted."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from planner.common.errors import NoSolutionError
from planner.common.units import read_only
from planner.design.candidates.balls import draw_ball_candidates
from planner.kinematics.bodies import Body
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld


def test_the_tool_point_is_on_the_ball_and_the_shares_are_equal(cell, pool, tool_pose):
    assert np.bincount(pool.ball).tolist() == [200] * 4
    for q, ball in list(zip(pool.q, pool.ball, strict=True))[::9]:
        assert np.linalg.norm(tool_pose(q)[0] - cell.p_BS[ball]) < 1e-8
    assert (pool.q > cell.robot.q_lower).all()
    assert (pool.q < cell.robot.q_upper).all()
    assert (pool.back > cell.robot.q_lower).all()
    assert (pool.back < cell.robot.q_upper).all()


def test_small_steps_of_the_tool_are_small_steps_of_the_joints(cell, pool, tool_pose):
    """A wrist that is all but straight turns the wrong way by as little as the robot's own errors."""
    nimble = np.inf
    for q in pool.q[::5]:
        at, J = np.concatenate(tool_pose(q)[:1]), np.empty((3, 6))
        for k in range(6):
            J[:, k] = (tool_pose(q + 1e-6 * np.eye(6)[k])[0] - at) / 1e-6
        turned = np.array([_rotation(tool_pose, q, k) for k in range(6)]).T
        nimble = min(nimble, np.linalg.svd(np.vstack([J, turned]))[1].min())
    assert nimble > 0.015


def _rotation(tool_pose, q, k):
    """Axis about which joint k turns the tool, by a difference."""
    before, after = tool_pose(q)[1], tool_pose(q + 1e-6 * np.eye(6)[k])[1]
    skew = (after @ before.T - np.eye(3)) / 1e-6
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


@pytest.mark.slow
def test_the_second_engine_finds_them_free(cell, pool):
    scene = CollisionWorld.from_cell(cell).scene
    away = FclWorld(scene)
    for ball in range(4):
        rows = np.flatnonzero(pool.ball == ball)[:12]
        assert FclWorld(scene.at_ball(ball)).distances(pool.q[rows]).min() >= cell.motion.clearance
        assert away.distances(pool.back[rows]).min() >= cell.motion.clearance


def test_only_tips_may_touch_and_only_the_ball_that_is_measured(cell, pool):
    scene = CollisionWorld.from_cell(cell).scene
    for ball in range(4):
        gone = set(scene.pairs) - set(scene.at_ball(ball).pairs)
        assert len(gone) == 3
        for a, b in gone:
            names = {scene.pieces[a].body.name, scene.pieces[b].body.name}
            assert f"ball {ball + 1}" in names
            assert any("tip" in name for name in names)
    centred = pool.q[pool.ball == 0][:20]
    assert CollisionWorld(scene).collides(centred).all()  # the tips touch the ball
    assert CollisionWorld(scene.at_ball(1)).collides(centred).all()  # ball 1 is not the one that is measured there
    assert not CollisionWorld(scene.at_ball(0)).collides(centred).any()


def test_every_filter_is_counted(pool):
    counts = list(asdict(pool.funnel).values())
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] >= 800
    assert len(pool.funnel.names) == len(counts)
    assert "approached freely" in pool.funnel.text()


def test_many_orientations(cell, pool, tool_pose):
    """The tool's axis comes from a wide cone, and turns about itself."""
    axes = np.array([tool_pose(q)[1] @ cell.tool.axis_F for q in pool.q[pool.ball == 2]])
    spread = np.rad2deg(np.arccos(np.clip(axes @ axes.T, -1, 1)))
    assert spread.max() > 100


def test_a_ball_out_of_reach_is_named_with_the_distance(cell, impatient):
    place = replace(cell.fixtures[0], p_BX=read_only(cell.fixtures[0].p_BX + np.array([0.8, 0, 0])))
    far = replace(cell, fixtures=(place,))
    with pytest.raises(NoSolutionError, match=r"ball 1, at \[1257, -308, 76\] mm.*out of reach by (\d+) mm") as caught:
        draw_ball_candidates(far, 100)
    told = float(str(caught.value).split("out of reach by ")[1].split(" ")[0])
    rng = np.random.default_rng(5)
    x = cell.map_position(rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (400_000, 6)))
    nearest = np.linalg.norm(x - far.p_BS[0], axis=1).min() * 1e3
    assert nearest - 30 < told < nearest + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("convention", "more"), [("mdh", "tool$"), ("urdf", "tool; a gripper that is taken off must be")]
)
def test_a_ball_in_a_box_is_named_with_what_collides(cell, impatient, convention, more):
    cell = replace(cell, robot=replace(cell.robot, convention=convention))
    T = np.eye(4)
    T[:3, 3] = cell.p_BS[1] + [0, 0, 0.05]
    lid = Body("lid", "box", (0.2, 0.2, 0.01), read_only(T))
    with pytest.raises(
        NoSolutionError, match=r"at ball 2:.*Every pose collides.*most often .*(lid|riser|stem).*" + more
    ):
        draw_ball_candidates(replace(cell, obstacles=(lid, _wall(cell, 0.05), _wall(cell, -0.05))), 100)


def _wall(cell, y):
    T = np.eye(4)
    T[:3, 3] = cell.p_BS[1] + [0, y, 0]
    return Body("wall", "box", (0.2, 0.01, 0.2), read_only(T))
