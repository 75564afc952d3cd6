"""The calibrated robot in the forms of other software, read by that software's own rules."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from planner.kinematics.chain import Chain
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import exported_models
from tests.not_everywhere import pin


def _changed(name: str, seed: int = 0, size: float = 2e-3) -> tuple:
    robot = load_robot(name)
    rng = np.random.default_rng(seed)
    return robot, {t.name: t.nominal + rng.normal(0.0, size) for t in robot.transforms}


@pytest.mark.parametrize("name", ["so101", "ur5e", "panda", "iiwa14"])
def test_pinocchio_reads_the_calibrated_urdf(name: str, tmp_path: Path) -> None:
    robot, values = _changed(name)
    path = tmp_path / "robot.urdf"
    path.write_text(dict(exported_models(robot, values))["robot.urdf"])
    model = pin.buildModelFromUrdf(str(path))
    assert list(model.names)[1:] == list(robot.joint_names)
    data, frame = model.createData(), model.getFrameId("flange")
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (20, robot.n_joints))
    deltas = [np.full(len(q), values[t.name] - t.nominal) for t in robot.transforms]
    motion = Chain(robot.transforms).forward(robot.theta(q), deltas)
    for k, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        np.testing.assert_allclose(data.oMf[frame].translation, motion.x[:, k], atol=1e-10)
        np.testing.assert_allclose(data.oMf[frame].rotation, motion.R[:, :, k], atol=1e-10)


def test_the_nominal_ur5e_is_the_file_that_comes_with_ur_description() -> None:
    """default_kinematics.yaml of the UR5e, by its keys and as rotations: one has more than one roll, pitch, yaw."""
    read = yaml.safe_load(dict(exported_models(load_robot("ur5e"), {}))["calibration.yaml"])["kinematics"]
    own = {
        "shoulder": (0, 0, 0.1625, 0, 0, 0),
        "upper_arm": (0, 0, 0, 1.570796327, 0, 0),
        "forearm": (-0.425, 0, 0, 0, 0, 0),
        "wrist_1": (-0.3922, 0, 0.1333, 0, 0, 0),
        "wrist_2": (0, -0.0997, -2.0e-11, 1.570796327, 0, 0),
        "wrist_3": (0, 0.0996, -2.0e-11, np.pi / 2, np.pi, np.pi),
    }
    assert list(read) == [*own, "hash"]
    for name, (x, y, z, roll, pitch, yaw) in own.items():
        found = read[name]
        np.testing.assert_allclose([found["x"], found["y"], found["z"]], [x, y, z], atol=1e-9)
        here = pin.rpy.rpyToMatrix(found["roll"], found["pitch"], found["yaw"])
        np.testing.assert_allclose(here, pin.rpy.rpyToMatrix(roll, pitch, yaw), atol=1e-8)


def test_the_calibrated_ur_is_the_product_of_its_origins() -> None:
    robot, values = _changed("ur5e")
    values |= {t.name: t.nominal for t in robot.transforms if t.name in ("a6", "alpha6")}
    read = yaml.safe_load(dict(exported_models(robot, values))["calibration.yaml"])["kinematics"]
    q = np.random.default_rng(2).uniform(-1.0, 1.0, (1, 6))
    deltas = [np.full(1, values[t.name] - t.nominal) for t in robot.transforms]
    T = pin.SE3.Identity()
    for turn, o in zip(q[0], list(read.values())[:6], strict=True):
        R = pin.rpy.rpyToMatrix(o["roll"], o["pitch"], o["yaw"])
        T = T * pin.SE3(R, np.array([o["x"], o["y"], o["z"]])) * pin.SE3(pin.exp3(np.array([0, 0, turn])), np.zeros(3))
    motion = Chain(robot.transforms).forward(robot.theta(q), deltas)
    np.testing.assert_allclose(T.translation, motion.x[:, 0], atol=1e-10)
