"""The loop closes: with the corrected angles the real robot stands where the nominal one should have stood."""

from dataclasses import replace

import numpy as np
import pytest

from planner.common.units import read_only
from planner.compensation.correction import NominalFlange, correct_joints
from planner.compensation.few_axes import TurnWeights
from planner.kinematics.chain import Transform
from planner.kinematics.inverse_kinematics import tool_pose
from tests.compensation.robots import BentRobot, bent, exact, pin_flange, regular_angles

ROBOTS = ["comau-nj130", "kuka-kr6-r700", "ur10", "abb-irb120"]


@pytest.mark.parametrize("name", [ROBOTS[0], *(pytest.param(n, marks=pytest.mark.slow) for n in ROBOTS[1:])])
def test_a_thousand_targets_close_below_a_micrometre(name):
    robot, real = bent(name)
    q = regular_angles(robot, 1000)
    done = correct_joints(robot, NominalFlange(robot), real, q)
    assert done.solved.all()
    assert done.within.all()
    (p, R), (p_new, R_new) = NominalFlange(robot).flange(q), real.flange(done.q)
    assert np.linalg.norm(p - p_new, axis=1).max() < 1e-6
    assert np.arccos(np.clip((np.einsum("nij,nij->n", R, R_new) - 1) / 2, -1, 1)).max() < 1e-6
    before = np.linalg.norm(real.flange(q)[0] - p, axis=1)
    assert before.min() > 1e-5  # there was something to correct


@pytest.mark.parametrize("name", ROBOTS)
def test_the_loop_closes_for_pinocchio_too(name):
    robot, real = bent(name, seed=1)
    q = regular_angles(robot, 20, seed=1)
    done = correct_joints(robot, NominalFlange(robot), real, q)
    for wanted, corrected in zip(q, done.q, strict=True):
        T, T_new = pin_flange(exact(robot), wanted), pin_flange(real, corrected)
        assert np.abs(T - T_new).max() < 1e-6


@pytest.mark.parametrize("name", ROBOTS)
def test_the_jacobian_is_the_derivative_of_the_flange(name):
    robot, _ = bent(name)
    q, h = regular_angles(robot, 5), 1e-6
    J, nominal = tool_pose(robot.chain, robot, q)[2], NominalFlange(robot)
    _, R = nominal.flange(q)
    for j in range(6):
        (p1, R1), (p0, R0) = (nominal.flange(q + s * h * np.eye(6)[j]) for s in (1, -1))
        W = (R1 - R0) / (2 * h) @ np.swapaxes(R, 1, 2)
        turn = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
        np.testing.assert_allclose(J[:, :, j], np.hstack([(p1 - p0) / (2 * h), turn]), atol=1e-8)


def test_a_known_error_of_a_zero_position_is_undone():
    robot, _ = bent("comau-nj130")
    delta = np.array([0.01 if t.joint == 2 else 0.0 for t in robot.transforms])
    q = regular_angles(robot, 50)
    done = correct_joints(robot, NominalFlange(robot), BentRobot(robot, delta), q)
    expected = np.linalg.solve(robot.coupling_matrix, np.eye(6)[2] * -0.01)
    np.testing.assert_allclose(done.moved, np.tile(expected, (50, 1)), atol=1e-8)


def test_targets_that_cannot_be_corrected_are_marked():
    robot, real = bent("kuka-kr6-r700")
    q = np.radians([[0, -90, 90, 0, 0, 0], [10, -70, 100, 20, 40, 349.999], [10, -70, 100, 20, 40, 30]])
    sign = -np.sign(robot.coupling_matrix[5, 5])
    turned = BentRobot(robot, np.array([sign * 0.01 if t.joint == 5 else 0.0 for t in robot.transforms]))
    assert correct_joints(robot, NominalFlange(robot), turned, q).within.tolist() == [True, False, True]
    done = correct_joints(robot, NominalFlange(robot), real, q)
    assert done.usable.tolist()[0] is False  # a straight wrist: the lost direction cannot be corrected
    assert done.usable.tolist()[2] is True


def test_seven_joints_move_as_little_as_possible():
    robot, _ = bent("comau-nj130")
    seven = seven_joints(robot)
    q = np.hstack([regular_angles(robot, 100), np.full((100, 1), 0.3)])
    rng = np.random.default_rng(2)
    arm = BentRobot(seven, rng.normal(0, 1e-4, len(seven.transforms)))
    done = correct_joints(seven, NominalFlange(seven), arm, q)
    assert done.solved.all()
    J = tool_pose(seven.chain, seven, q)[2]
    null = np.linalg.svd(J)[2][:, -1]
    along = np.abs(np.einsum("ni,ni->n", null, done.moved)) / np.linalg.norm(done.moved, axis=1)
    assert along.max() < 0.02


def test_five_joints_keep_position_and_the_axis_where_it_alone_counts():
    robot, _ = bent("comau-nj130")
    five = five_joints(robot)
    rng = np.random.default_rng(3)
    arm = BentRobot(five, rng.normal(0, 1e-4, len(five.transforms)))
    q = regular_angles(robot, 100)[:, :5]
    done = correct_joints(five, NominalFlange(five), arm, q, weights=TurnWeights(1.0, 0.0))
    assert done.solved.mean() > 0.95
    (p, R), (p_new, R_new) = NominalFlange(five).flange(q), arm.flange(done.q)
    assert np.abs(p - p_new)[done.solved].max() < 1e-6
    off = np.abs(R[:, :, 2] - R_new[:, :, 2]).max(axis=1)
    assert (off < 1e-6).mean() > 0.95  # elsewhere a direction that is nearly lost is not chased
    assert np.abs(R - R_new)[done.solved].max() > 1e-6  # the turn about the axis is not theirs to keep


def seven_joints(robot):
    """A seventh joint about the flange's x axis, 0.1 m further out."""
    more = (Transform("d7", "translation", 2, 0.1), Transform("theta7", "rotation", 0, 0.0, 6))
    return _with_joints(robot, (*robot.transforms, *more), 7)


def five_joints(robot):
    """Without the last joint; what follows it stays, and a flange that points across the last axis."""
    kept = tuple(t if t.joint != 5 else replace(t, joint=None) for t in robot.transforms)
    return _with_joints(robot, (*kept, Transform("d8", "translation", 0, 0.05)), 5)


def _with_joints(robot, transforms, n):
    def cut(v, fill):
        return read_only(np.append(v, fill)[:n])

    A = np.eye(7)
    A[:6, :6] = robot.coupling_matrix
    return replace(
        robot,
        transforms=transforms,
        coupling_matrix=read_only(A[:n, :n]),
        theta_zero=cut(robot.theta_zero, 0.0),
        q_lower=cut(robot.q_lower, -3.0),
        q_upper=cut(robot.q_upper, 3.0),
        speed=cut(robot.speed, 1.0),
    )
