"""Joints that slide: frames, Jacobians and gravity against pinocchio and finite differences, and what files may say."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.cell.places import joint_keys
from planner.common.errors import InputError
from planner.compensation.correction import NominalFlange, correct_joints
from planner.compensation.nominal_angles import target_problems
from planner.effects.context import gravity_torque
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
from planner.kinematics.robot import SLIDE
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import RobotCorrections, write_robot
from planner.model.gauge_frames import JointZero
from planner.model.misfit_place import MisfitPlace
from planner.motion.collision.engines import pin_model
from tests.kinematics.sliding_arms import AXES, lift_text, write_rail
from tests.not_everywhere import pin

STATES = 20


def states(robot, seed=0):
    return np.random.default_rng(seed).uniform(robot.q_lower, robot.q_upper, (STATES, robot.n_joints))


@pytest.mark.parametrize("axis", AXES)
def test_frames_of_a_urdf_with_a_lift_are_those_of_pinocchio(tmp_path: Path, axis: str) -> None:
    (tmp_path / "lift.urdf").write_text(lift_text(AXES[axis]))
    robot = load_robot(tmp_path / "lift.urdf", tip="l6")
    assert robot.joint_units == ("mm", *["deg"] * 6)
    assert joint_keys(robot, "home") == "home_deg and home_mm"
    assert np.allclose(np.rad2deg([robot.q_lower[0], robot.q_upper[0], robot.speed[0]]), [-100, 400, 200])  # in mm
    model = pin.buildModelFromXML(lift_text(AXES[axis]))
    data, tip = model.createData(), model.getFrameId("l6")
    at = [model.joints[model.getJointId(n)].idx_q for n in robot.joint_names]
    for q in states(robot):
        full = pin.neutral(model)
        full[at] = np.where(robot.slides, q * SLIDE, q)
        pin.framesForwardKinematics(model, data, full)
        motion = robot.chain.forward(robot.theta(q[None]))
        assert np.allclose(motion.x[:, 0], data.oMf[tip].translation, atol=1e-12)
        assert np.allclose(motion.R[:, :, 0], data.oMf[tip].rotation, atol=1e-12)


@pytest.mark.parametrize("convention", ["dh", "mdh", "urdf"])
def test_the_tools_jacobian_is_its_derivative(tmp_path: Path, convention: str) -> None:
    robot = robot_of(tmp_path, convention)
    q, h = states(robot, 1), 1e-6
    x, R, J = tool_pose(robot.chain, robot, q)
    for k in range(robot.n_joints):
        step = h * np.eye(robot.n_joints)[k]
        ahead, behind = (tool_pose(robot.chain, robot, q + s * step) for s in (1, -1))
        assert np.allclose(J[:, :3, k], (ahead[0] - behind[0]) / (2 * h), atol=1e-8)
        turn = (ahead[1] - behind[1]) / (2 * h) @ np.swapaxes(R, 1, 2)
        assert np.allclose(J[:, 3:, k], np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1), atol=1e-8)
    found, good = solve_pose_ik(robot.chain, robot, q + 0.05, x, R, 40)
    assert good.all()
    assert np.allclose(tool_pose(robot.chain, robot, found)[0], x, atol=1e-8)


def robot_of(folder: Path, convention: str):
    if convention != "urdf":
        return load_robot(write_rail(folder, convention))
    (folder / "lift.urdf").write_text(lift_text(AXES["slanted"]))
    return load_robot(folder / "lift.urdf", tip="l6")


@pytest.mark.parametrize("convention", ["dh", "mdh"])
def test_the_force_of_gravity_along_a_slide_is_that_of_newton_and_euler(tmp_path: Path, convention: str) -> None:
    robot = robot_of(tmp_path, convention)
    model, _ = pin_model(robot)
    gravity = np.array([1.0, 2.0, -9.5])
    model.gravity.linear, data = gravity, model.createData()
    theta = robot.theta(states(robot, 2))
    loads = tuple((end, m.mass, m.com) for end, m in zip(robot.link_end[1:], robot.masses, strict=True))
    held = np.array([pin.rnea(model, data, t, np.zeros(model.nv), np.zeros(model.nv)) for t in theta])
    assert np.allclose(gravity_torque(robot.chain, theta, gravity, loads), -held, atol=1e-9)
    assert np.abs(held[:, 0]).max() > 50  # [N] it is no zero that agrees


def test_a_corrected_urdf_slides_where_the_corrected_chain_does(tmp_path: Path) -> None:
    (tmp_path / "lift.urdf").write_text(lift_text(AXES["slanted"]))
    robot = load_robot(tmp_path / "lift.urdf", tip="l6")
    free = [
        t for t in robot.transforms if not t.fixed and t.name.rstrip("0123456789") in ("d", "x", "y", "rx", "ry", "rz")
    ]
    rng = np.random.default_rng(3)
    values = tuple((t.name, t.nominal + 1e-3 * rng.standard_normal()) for t in free)
    assert "d1" in dict(values)
    written = dict(write_robot(robot, RobotCorrections(values, (), None, "by hand")))
    for name, text in written.items():
        (tmp_path / name).write_text(text)
    corrected, q = load_robot(tmp_path / "robot.toml"), states(robot, 4)
    delta = [dict(values).get(t.name, t.nominal) - t.nominal for t in robot.transforms]
    there = robot.chain.forward(robot.theta(q), delta).x
    assert np.allclose(corrected.chain.forward(corrected.theta(q)).x, there, atol=1e-10)


WRONG = {
    "limit_mm = [-1000, 3000]": ("limit_deg = [-90, 90]", "limit_deg"),
    "speed_mm_s = 1500": ("speed_deg_s = 100", "speed_deg_s"),
    "limit_mm = [-1000,": ("limit_mm = [-1.0, 3.0]\n#", "look like metres"),
    'variable = "d"\n': ("", "variable"),
}


@pytest.mark.parametrize("old", WRONG)
def test_a_unit_of_the_other_kind_of_joint_is_told(tmp_path: Path, old: str) -> None:
    path = write_rail(tmp_path, "dh")
    new, said = WRONG[old]
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(said)):
        load_robot(path)


def test_limits_of_a_lift_in_millimetres_are_told(tmp_path: Path) -> None:
    (tmp_path / "lift.urdf").write_text(lift_text().replace('upper="0.4"', 'upper="400"'))
    with pytest.raises(InputError, match="are these millimetres"):
        load_robot(tmp_path / "lift.urdf", tip="l6")


def test_a_lift_that_says_no_speed_is_asked_for_it_in_millimetres(tmp_path: Path) -> None:
    from planner.cell.reading import load_cell
    from tests.workflow.conftest import small_cell

    (tmp_path / "lift.urdf").write_text(lift_text().replace('velocity="0.2"', 'velocity="0"'))
    robot = ('robot = "ur10"', 'robot = "lift.urdf"\ntip = "l6"\nhome_mm = [100]')
    with pytest.raises(InputError, match=r"(?s)joint 1 has no speed_mm_s.*name = \"lift\"\nspeed_mm_s = 70"):
        load_cell(small_cell("ur10/edbb", tmp_path, robot))


def test_values_of_joints_are_said_in_their_own_unit(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, "urdf")
    assert robot.joint_text(0, np.deg2rad(12.5), ".1f") == "12.5 mm"
    assert robot.joint_text(1, np.deg2rad(12.5), ".1f") == "12.5°"


def test_a_target_beyond_the_lift_is_told_in_mm(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, "urdf")
    q = np.deg2rad([[399.5, 10, -70, 60, 20, 40, 30]])

    up = tool_pose(robot.chain, robot, q)[2][0, :3, 0]  # where the lift goes [m/rad]

    class Low:
        """The same arm, its lift 100 mm too low."""

        def flange(self, q):
            x, R, _ = tool_pose(robot.chain, robot, q)
            return x - 0.1 * up / np.linalg.norm(up), R

    found = correct_joints(robot, NominalFlange(robot), Low(), q)
    (line, why) = target_problems([7], robot, found)[0]
    assert line == 7
    assert re.search(
        r"joint 1 would have to (stand at [\d.]+ mm; -100 … 400 mm|move by [\d.]+ mm, further than 10 mm)", why
    ), why


@pytest.mark.parametrize("section", ["misfit", "zero"])
def test_what_is_said_of_a_slide_is_in_mm_in_the_file_and_comes_back(section: str) -> None:
    if section == "misfit":
        said = MisfitPlace(anywhere=1e-4, there=2e-4, joint=1, range=(0.1, 0.2), slides=True)
        key, values = "range_mm", [np.rad2deg(0.1), np.rad2deg(0.2)]
    else:
        said = JointZero(joint=1, offset=0.01, offset_std=0.001, slides=True)
        key, values = "zero_mm", np.rad2deg(0.01)
    written = said.model_dump(mode="json", by_alias=True)
    assert np.allclose(written[key], values)
    assert key.replace("_mm", "_deg") not in written
    assert "slides" not in written
    back = type(said).model_validate(written)
    assert back.slides
    assert np.allclose(back.model_dump(mode="json", by_alias=True)[key], values)
