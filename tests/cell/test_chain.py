"""The chain against pinocchio, against finite differences, and its two passes against each other."""

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.kinematics.chain import Chain
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.motion.collision.engines import pin_model
from tests.not_everywhere import pin

ROBOTS = list_robots()


def states(robot, count, seed=0):
    return np.random.default_rng(seed).uniform(robot.q_lower, robot.q_upper, (count, robot.n_joints))


@pytest.mark.parametrize("name", ROBOTS)
def test_positions_agree_with_pinocchio(name):
    robot = load_robot(name)
    q = states(robot, 50)
    model, frames = pin_model(robot)
    data = model.createData()
    chain = robot.chain
    motion = chain.forward(robot.theta(q))
    joint, placement = frames[-1]
    for k, theta in enumerate(robot.theta(q)):
        pin.forwardKinematics(model, data, theta)
        T = data.oMi[joint] * placement * pin.SE3(robot.flange_frame())
        np.testing.assert_allclose(motion.x[:, k], T.translation, atol=1e-12)
        np.testing.assert_allclose(motion.R[:, :, k], T.rotation, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_screws_agree_with_finite_differences_for_every_transform(name):
    robot = load_robot(name)
    theta = robot.theta(states(robot, 20, seed=1))
    chain = robot.chain
    screws = chain.forward(theta).point_screws()
    h = 1e-6
    for k in range(len(chain)):
        step = np.zeros(len(chain))
        step[k] = h
        moved = (chain.forward(theta, step).x - chain.forward(theta, -step).x) / (2 * h)
        np.testing.assert_allclose(screws[k], moved, atol=1e-7, err_msg=chain.transforms[k].name)


@pytest.mark.parametrize("name", ROBOTS)
def test_screws_hold_away_from_the_nominal_values_too(name):
    """Errors of every kind at once, one of them different for each sample: what effects will do."""
    robot = load_robot(name)
    theta = robot.theta(states(robot, 10, seed=2))
    chain, rng = robot.chain, np.random.default_rng(3)
    delta = [rng.normal(scale=1e-2, size=10) if k % 3 == 0 else rng.normal(scale=1e-2) for k in range(len(chain))]
    screws = chain.forward(theta, delta).point_screws()
    h = 1e-6
    for k in range(len(chain)):
        up, down = list(delta), list(delta)
        up[k], down[k] = delta[k] + h, delta[k] - h
        moved = (chain.forward(theta, up).x - chain.forward(theta, down).x) / (2 * h)
        np.testing.assert_allclose(screws[k], moved, atol=1e-7)


@pytest.mark.parametrize("name", ROBOTS)
def test_carrying_a_point_down_agrees_with_the_forward_pass(name):
    robot = load_robot(name)
    theta = robot.theta(states(robot, 30, seed=4))
    motion = robot.chain.forward(theta)
    p = np.array([0.1, -0.2, 0.3])
    np.testing.assert_allclose(
        robot.chain.carry(theta, p), (motion.x + np.einsum("ijn,j->in", motion.R, p)).T, atol=1e-12
    )
    turned = np.einsum("ijn,j->ni", motion.R, p)
    np.testing.assert_allclose(robot.chain.carry(theta, p, point=False), turned, atol=1e-12)


@pytest.mark.parametrize("name", shipped_cells())
def test_map_jacobian_agrees_with_finite_differences(name):
    cell = load_cell(name)
    q = states(cell.robot, 20, seed=5)
    J = cell.map_jacobian(q)
    h = 1e-6
    for j in range(cell.robot.n_joints):
        step = np.zeros(cell.robot.n_joints)
        step[j] = h
        moved = (cell.map_position(q + step) - cell.map_position(q - step)) / (2 * h)
        np.testing.assert_allclose(J[:, :, j], moved, atol=1e-8)


def test_an_empty_chain_stays_at_the_base():
    motion = Chain(()).forward(np.zeros((3, 0)))
    assert not motion.x.any()
    np.testing.assert_array_equal(motion.R[:, :, 1], np.eye(3))
