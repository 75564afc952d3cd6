"""Arms that many people own: their rows against the joint origins of the makers' own URDF files, through pinocchio."""

import numpy as np
import pytest

from planner.kinematics.robot_reader import load_robot
from tests.not_everywhere import pin

H, PI = np.pi / 2, np.pi
SO101 = [
    ((0.0388353, -8.97657e-09, 0.0624), (3.14159, 4.18253e-17, -3.14159)),
    ((-0.0303992, -0.0182778, -0.0542), (-1.5708, -1.5708, 0)),
    ((-0.11257, -0.028, 0), (0, 0, 1.5708)),
    ((-0.1349, 0.0052, 0), (0, 0, -1.5708)),
    ((0, -0.0611, 0.0181), (1.5708, 0.0486795, 3.14159)),
    ((-0.0079, -0.000218121, -0.0981274), (0, 3.14159, 0)),
]
UR5E = [
    ((0, 0, 0.1625), (0, 0, 0)),
    ((0, 0, 0), (1.570796327, 0, 0)),
    ((-0.425, 0, 0), (0, 0, 0)),
    ((-0.3922, 0, 0.1333), (0, 0, 0)),
    ((0, -0.0997, -2.044881182297852e-11), (1.570796327, 0, 0)),
    ((0, 0.0996, -2.042830148012698e-11), (1.570796326589793, PI, PI)),
    ((0, 0, 0), (0, 0, 0)),
]
PANDA = [
    ((0, 0, 0.333), (0, 0, 0)),
    ((0, 0, 0), (-H, 0, 0)),
    ((0, -0.316, 0), (H, 0, 0)),
    ((0.0825, 0, 0), (H, 0, 0)),
    ((-0.0825, 0.384, 0), (-H, 0, 0)),
    ((0, 0, 0), (H, 0, 0)),
    ((0.088, 0, 0), (H, 0, 0)),
    ((0, 0, 0.107), (0, 0, 0)),
]
IIWA14 = [
    ((0, 0, 0.1575), (0, 0, 0)),
    ((0, 0, 0.2025), (H, 0, PI)),
    ((0, 0.2045, 0), (H, 0, PI)),
    ((0, 0, 0.2155), (H, 0, 0)),
    ((0, 0.1845, 0), (-H, PI, 0)),
    ((0, 0, 0.2155), (H, 0, 0)),
    ((0, 0.081, 0), (-H, PI, 0)),
    ((0, 0, 0.045), (0, 0, 0)),
]


ARMS = [("so101", SO101, 5), ("ur5e", UR5E, 0.01), ("panda", PANDA, 0.01), ("iiwa14", IIWA14, 0.01)]


@pytest.mark.parametrize(("name", "origins", "micrometres"), ARMS)
def test_the_flange_is_where_the_makers_urdf_has_it(name: str, origins: list, micrometres: float) -> None:
    robot = load_robot(name)
    q = np.random.default_rng(0).uniform(
        np.maximum(robot.q_lower, -3), np.minimum(robot.q_upper, 3), (50, robot.n_joints)
    )
    motion = robot.chain.forward(robot.theta(q))
    for k, row in enumerate(q):
        T = pin.SE3.Identity()
        for (xyz, rpy), turn in zip(origins, [*row, 0.0], strict=True):
            T = (
                T
                * pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
                * pin.SE3(pin.exp3(np.array([0, 0, turn])), np.zeros(3))
            )
        assert np.linalg.norm(motion.x[:, k] - T.translation) < micrometres * 1e-6
        assert np.linalg.norm(pin.log3(T.rotation.T @ motion.R[:, :, k])) < 2e-5


@pytest.mark.parametrize("name", ["so101", "ur5e", "panda", "iiwa14"])
def test_every_number_has_a_source(name: str) -> None:
    said = dict(load_robot(name).sources)
    assert {"kinematics", "limits", "speeds", "accelerations", "masses", "bodies", "repeatability"} <= set(said)


@pytest.mark.parametrize(("name", "z_mm"), [("ur5e", 62.8), ("panda", 926.0), ("iiwa14", 1306.0), ("so101", 226.47)])
def test_the_flange_at_zero_is_the_data_sheets(name: str, z_mm: float) -> None:
    robot = load_robot(name)
    x = robot.chain.forward(robot.theta(np.zeros((1, robot.n_joints)))).x
    assert 1e3 * float(x[2, 0]) == pytest.approx(z_mm, abs=0.1)
