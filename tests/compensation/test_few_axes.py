"""Five axes meet a place and not every turn: the tool comes nearer, and what is left of its turn is stated truly."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize
from scipy.spatial.transform import Rotation

from planner.common.files import write_text
from planner.compensation.compensated_file import compensate_file
from planner.compensation.correction import NominalFlange, correct_joints, move_limit, near_singular
from planner.compensation.few_axes import TurnWeights
from planner.kinematics.robot_reader import load_robot
from tests.compensation.robots import BentRobot, exact, flange_pose

RX150 = str(Path(__file__).parent / "arms" / "rx150.urdf")
ZERO, TWIST, LENGTH = np.deg2rad(2.0), np.deg2rad(0.5), 1e-3  # of printed arms: zeros, other angles [rad], lengths [m]


@cache
def arm(name, seed):
    robot = load_robot(name)
    robot = replace(robot, priors=replace(robot.priors, length=LENGTH, angle=ZERO))  # what [priors] says of such an arm
    rng = np.random.default_rng(seed)
    sizes = [LENGTH if t.kind == "translation" else TWIST if t.joint is None else ZERO for t in robot.transforms]
    return robot, BentRobot(robot, rng.normal(0.0, sizes))


def reached(robot, n, seed=0):
    """Targets that the arm reaches, anywhere within its limits, all of it above the table."""
    q = np.random.default_rng(seed).uniform(robot.q_lower, robot.q_upper, (4 * n, robot.n_joints))
    return q[NominalFlange(robot).flange(q)[0][:, 2] > 0.03][:n]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["so101", RX150])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_nearly_all_reachable_targets_come_nearer(name, seed):
    robot, real = arm(name, seed)
    q = reached(robot, 80, seed)
    done = correct_joints(robot, NominalFlange(robot), real, q)
    wanted = [flange_pose(exact(robot), v)[:3, 3] for v in q]
    before, after = (
        np.array([np.linalg.norm(flange_pose(real, v)[:3, 3] - x) for v, x in zip(angles, wanted, strict=True)])
        for angles in (q, done.q)
    )
    np.testing.assert_allclose(done.after.distance, after, atol=1e-9)
    assert (done.usable & (after < before)).mean() >= 0.95
    assert (after <= before + 1e-12).all()  # those that are left are left as they were
    assert np.median(after) < 1e-8 < np.median(before) / 1e4


@pytest.mark.slow
def test_beside_its_first_axis_the_arm_comes_as_near_as_its_joints_may_move():
    robot, real = arm(RX150, 1)
    q = reached(robot, 100, 1)[[37, 44, 93, 95]]  # would ask joint 1 for 20 to 60 degrees
    done = correct_joints(robot, NominalFlange(robot), real, q)
    wanted = [flange_pose(exact(robot), v)[:3, 3] for v in q]
    before, after = (
        np.array([np.linalg.norm(flange_pose(real, v)[:3, 3] - x) for v, x in zip(angles, wanted, strict=True)])
        for angles in (q, done.q)
    )
    assert (np.abs(done.moved).max(axis=1) <= move_limit(robot)).all()
    assert (after < 0.5 * before).all()
    assert done.usable.all()
    for start, place, distance in zip(q, wanted, after, strict=True):
        low, high = (
            np.maximum(robot.q_lower, start - move_limit(robot)),
            np.minimum(robot.q_upper, start + move_limit(robot)),
        )
        peer = least_squares(lambda v, x=place: flange_pose(real, v)[:3, 3] - x, start, bounds=(low, high), xtol=1e-12)
        assert distance < 1.001 * np.linalg.norm(peer.fun) + 1e-7


@pytest.mark.parametrize(("name", "seed"), [("so101", 0), (RX150, 1)])
def test_rounding_decides_no_angle(name, seed):
    """Near the first axis and near limits too, where steps of Newton lead anywhere."""
    robot, real = arm(name, seed)
    q = reached(robot, 60, seed)
    moved = np.random.default_rng(0).normal(0.0, 1e-13, q.shape)
    one, other = (correct_joints(robot, NominalFlange(robot), real, angles).q for angles in (q, q + moved))
    np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.slow
def test_what_is_left_of_the_turn_is_the_least_that_the_place_allows():
    robot, real = arm("so101", 0)
    weights = TurnWeights(1.0, 0.3)
    q = np.deg2rad([[10, -20, 30, 40, 20], [-40, 10, 20, 30, -60]])
    done = correct_joints(robot, NominalFlange(robot), real, q, weights=weights)

    def cost(angles, wanted):
        turn = Rotation.from_matrix(wanted[:3, :3].T @ flange_pose(real, angles)[:3, :3]).as_rotvec()
        return float(((weights.row * turn) ** 2).sum())

    for k, start in enumerate(q):
        wanted = flange_pose(exact(robot), start)
        place = {"type": "eq", "fun": lambda v, x=wanted: (flange_pose(real, v)[:3, 3] - x[:3, 3]) * 1e3}
        peer = minimize(cost, start, (wanted,), "SLSQP", constraints=place, options={"ftol": 1e-11, "maxiter": 300})
        assert cost(done.q[k], wanted) == pytest.approx(peer.fun, rel=1e-3)
        turn = Rotation.from_matrix(wanted[:3, :3].T @ flange_pose(real, done.q[k])[:3, :3]).as_rotvec()
        assert done.after.tilt[k] == pytest.approx(np.hypot(turn[0], turn[1]), abs=1e-9)
        assert done.after.spin[k] == pytest.approx(abs(turn[2]), abs=1e-9)


def test_the_weights_say_what_is_kept():
    robot, real = arm("so101", 1)
    q = np.deg2rad([[10, -20, 30, 40, 20], [-40, 10, 20, 30, -60], [25, -10, 45, 20, 0]])

    def corrected(weights):
        return correct_joints(robot, NominalFlange(robot), real, q, weights=weights)

    axis, spin = corrected(TurnWeights(1.0, 0.0)), corrected(TurnWeights(0.0, 1.0))
    assert (spin.after.spin < 1e-6).all()
    assert (axis.after.tilt <= spin.after.tilt + 1e-9).all()
    assert (np.hypot(axis.after.distance, spin.after.distance) < 1e-8).all()


def test_the_tool_point_is_what_comes_to_its_place():
    robot, real = arm("so101", 0)
    q = np.deg2rad([[10, -20, 30, 40, 20]])
    T_FT = np.eye(4)
    T_FT[:3, 3] = 0.02, 0.0, 0.06
    done = correct_joints(robot, NominalFlange(robot), real, q, T_FT[None])
    wanted, stands = flange_pose(exact(robot), q[0]) @ T_FT, flange_pose(real, done.q[0]) @ T_FT
    assert np.abs(wanted[:3, 3] - stands[:3, 3]).max() < 1e-8


def test_five_axes_are_no_singular_position():
    robot, _ = arm("so101", 0)
    q = np.deg2rad([[10, -20, 30, 40, 20], [0, 0, -90, 0, 0]])
    assert not near_singular(robot, q)[0]
    six, _ = arm("kuka-kr6-r700", 0)
    straight, bent = [10, -70, 100, 20, 0.5, 30], [10, -70, 100, 20, 40, 30]
    assert near_singular(six, np.deg2rad([straight, bent])).tolist() == [True, False]


@pytest.mark.slow
def test_a_table_is_corrected_and_says_what_is_left(tmp_path):
    robot, real = arm("so101", 0)
    q = np.rad2deg(reached(robot, 12))
    rows = [",".join(f"{v:.6f}" for v in row) for row in q]
    table = tmp_path / "targets.csv"
    write_text(table, "\n".join(["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg", *rows]) + "\n")
    done = compensate_file(table, robot, real)
    left = done.report.turns_left
    assert left.nearer_share >= 0.9
    assert "an arm of 5 axes brings its tool to a place" in done.summary
    told = [line for line, why in (*done.report.notes, *done.report.kept) if "singular" in why]
    assert near_singular(robot, np.deg2rad([q[line - 2] for line in told]).reshape(-1, 5)).all()
    assert [entry["line"] for entry in left.content()] == [t.line for t in done.targets]
    assert np.median([entry["after_mm"] for entry in left.content()]) < 1e-4
