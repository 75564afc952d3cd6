"""An arm's own calibration as its maker has it: rows far out at parallel axes, UR's and ROS's files."""

from pathlib import Path

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.kinematics.parallel_axes import shorten_offsets
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import RobotCorrections, exported_models, joint_origins, write_robot
from tests.command import edbb

UR = (  # of one UR5e-like arm: a [m], d [m], alpha [rad], theta [rad]
    (0.0000121, 0.162381, 1.5705, 0.0000001), (-0.0021, 384.4363, 0.0008812, 1.5312),
    (-0.0184, -391.0521, 0.0018331, 4.7518), (-0.0000512, 6.74870, 1.570801, -0.0001),
    (0.0000711, 0.099792, -1.570411, 0.0000011), (0.0, 0.099581, 0.0, 0.0000002),
)  # fmt: skip
KEYS = ("a", "d", "alpha", "theta")


def by_plain_rows(convention: str, rows, q) -> np.ndarray:
    """Return where the flange stands, (4, 4), by multiplying plain DH matrices in extended precision."""
    T = np.eye(4, dtype=np.longdouble)
    for row, angle in zip(rows, q, strict=True):
        a, d, alpha, theta = map(np.longdouble, row)
        c, s = np.cos(theta + np.longdouble(angle)), np.sin(theta + np.longdouble(angle))
        about_z = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]], dtype=np.longdouble)
        c, s = np.cos(alpha), np.sin(alpha)
        about_x = np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]], dtype=np.longdouble)
        T = T @ (about_z @ about_x if convention == "dh" else about_x @ about_z)
    return T.astype(float)


def table(path: Path, convention: str, rows) -> Path:
    lines = [f"# convention: {convention}", "a_m,d_m,alpha_rad,theta_rad"]
    path.write_text("\n".join([*lines, *(",".join(map(repr, map(float, row))) for row in rows)]))
    return path


def flange(robot, q) -> np.ndarray:
    stand = robot.chain.forward(robot.theta(q[None]))
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = stand.R[:, :, 0], stand.x[:, 0]
    return out


def draw(rng: np.random.Generator) -> list[tuple[float, ...]]:
    """Return rows of an arm whose axes 2, 3 and 4 are nearly parallel, as a calibration by plain DH writes them."""
    far = rng.uniform(1, 1500) * rng.choice([-1, 1])
    tilt = rng.uniform(0.1, 0.5, 2) * min(1 / abs(far), 0.02)
    turns = rng.uniform(-3, 3, 6)
    return [
        (rng.normal(0, 1e-4), 0.16, 1.5708 + rng.normal(0, 1e-3), turns[0]),
        (rng.normal(0, 0.3), far, tilt[0], turns[1]),
        (rng.normal(0, 0.3), -far + rng.normal(0, 0.1), -tilt[1], turns[2]),
        (rng.normal(0, 1e-4), 0.1, 1.5708 + rng.normal(0, 1e-3), turns[3]),
        (rng.normal(0, 1e-4), 0.0997, -1.5708 + rng.normal(0, 1e-3), turns[4]),
        (0.0, 0.0996, 0.0, turns[5]),
    ]


@pytest.mark.parametrize("seed", [None, *range(6)])
@pytest.mark.parametrize("convention", ["dh", "mdh"])
def test_rows_far_out_are_the_same_arm_to_a_nanometre(tmp_path, convention, seed):
    rng = np.random.default_rng(seed)
    rows = list(UR) if seed is None else draw(rng)
    if convention == "mdh":  # the same chain: a and alpha stand a row later there
        moved = [(0.0, 0.0), *((row[0], row[2]) for row in rows[:-1])]
        rows = [(a, row[1], alpha, row[3]) for (a, alpha), row in zip(moved, rows, strict=True)]
    robot = load_robot(table(tmp_path / "arm.csv", convention, rows))
    assert sum(abs(t.nominal) for t in robot.transforms if t.kind == "translation") < 5.0
    assert {"beta2", "beta3"} <= {t.name for t in robot.transforms}
    for q in rng.uniform(-3, 3, (5, 6)):
        np.testing.assert_allclose(flange(robot, q), by_plain_rows(convention, rows, q), atol=1e-9)


def test_what_a_calibration_writes_of_such_an_arm_is_that_arm(tmp_path):
    robot = load_robot(table(tmp_path / "arm.csv", "dh", UR))
    nominal = next(t.nominal for t in robot.transforms if t.name == "d4")
    found = RobotCorrections((("d4", nominal + 1e-3),), (), None, "by hand")
    for name, text in write_robot(robot, found):
        (tmp_path / name).write_text(text)
    again = load_robot(tmp_path / "robot.toml")
    q = np.random.default_rng(1).uniform(-3, 3, 6)
    moved = [(*row[:1], row[1] + 1e-3 * (k == 3), *row[2:]) for k, row in enumerate(UR)]
    np.testing.assert_allclose(flange(again, q), by_plain_rows("dh", moved, q), atol=1e-9)
    np.testing.assert_allclose(flange(again.nominal_robot, q), by_plain_rows("dh", UR, q), atol=1e-9)
    done = edbb("robots", str(tmp_path / "arm.csv"), "-o", str(tmp_path / "copy"))
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(flange(load_robot(tmp_path / "copy"), q), by_plain_rows("dh", UR, q), atol=1e-9)


def test_rows_of_usual_arms_stay_as_they_are():
    usual = [dict(zip(KEYS, row, strict=True)) for row in ((0.1, 0.4, 0.0, 0.1), (0.5, -0.2, 0.01, 0.0))]
    assert shorten_offsets("dh", usual) == usual


CONF = """\
# robot: ur5e
## the arm's own calibration
[mounting]
delta_theta = [ -1.2e-05, 1.53, 4.75, -0.0001, 1.1e-06, 2e-07 ]
delta_a = [ 1.21e-05, 0.4229, 0.3738, -5.12e-05, 7.11e-05, 0 ]
delta_d = [ -0.000119, 384.4363, -391.0521,
            6.6154, 9.2e-05, -1.9e-05 ]
delta_alpha = [ -0.0003, 0.0008812, 0.0018331, 5e-06, 0.000385, 0 ]
[joint_checksum]
joint_checksum = [ 0xa1, 0xb2, 0xc3, 0xd4, 0xe5, 0xf6 ]
"""


def test_the_calibration_of_a_ur_adds_to_the_rows_of_its_model(tmp_path):
    (tmp_path / "calibration.conf").write_text(CONF)
    robot = load_robot(tmp_path / "calibration.conf")
    assert robot.name == "ur5e"
    assert robot.payload == 5.0
    nominal = ((0, 0.1625, np.pi / 2, 0), (-0.425, 0, 0, 0), (-0.3922, 0, 0, 0), (0, 0.1333, np.pi / 2, 0),
               (0, 0.0997, -np.pi / 2, 0), (0, 0.0996, 0, 0))  # fmt: skip
    deltas = (
        (1.21e-05, -0.000119, -0.0003, -1.2e-05), (0.4229, 384.4363, 0.0008812, 1.53),
        (0.3738, -391.0521, 0.0018331, 4.75), (-5.12e-05, 6.6154, 5e-06, -0.0001),
        (7.11e-05, 9.2e-05, 0.000385, 1.1e-06), (0, -1.9e-05, 0, 2e-07),
    )  # fmt: skip
    rows = [tuple(a + b for a, b in zip(*pair, strict=True)) for pair in zip(nominal, deltas, strict=True)]
    for q in np.random.default_rng(0).uniform(-3, 3, (5, 6)):
        np.testing.assert_allclose(flange(robot, q), by_plain_rows("dh", rows, q), atol=1e-9)


@pytest.mark.parametrize(
    ("there", "instead", "said"),
    [
        ("# robot: ur5e\n", "", "add a line '# robot: ur5e' at its head"),
        ("ur5e\n", "ur5x\n", "no shipped robot and no file"),
        ("delta_a =", "delta_b =", "no delta_a = "),
        ("[mounting]", "delta_beta = [0, 0, 0, 0, 0, 0]", "delta_beta is not known"),
        ("6.6154, ", "", "delta_d has 5 numbers, the robot has 6 joints"),
        ("6.6154", "6,6154x", "delta_d: '6154x' is no number"),
    ],
)
def test_a_calibration_that_is_not_understood_is_refused(tmp_path, there, instead, said):
    (tmp_path / "calibration.conf").write_text(CONF.replace(there, instead))
    with pytest.raises(InputError, match=said):
        load_robot(tmp_path / "calibration.conf")


def test_origins_that_ros_has_of_an_arm_are_that_arm(tmp_path):
    """The product writes such a file of a calibrated UR; read back it is the same arm, as is its plain chain."""
    robot = load_robot("ur10")
    values = {t.name: t.nominal + 1e-3 * (k % 3) for k, t in enumerate(robot.transforms)}
    text = dict(exported_models(robot, values))["calibration.yaml"]
    (tmp_path / "ur_calibration.yaml").write_text(text)
    (tmp_path / "arm.yaml").write_text(text.replace("  hash: calib_edbb\n", ""))
    off = [values[t.name] - t.nominal for t in robot.transforms]
    behind = joint_origins(robot, values)[1]  # what is found behind the last joint has no place in such a file
    for name in ("ur_calibration.yaml", "arm.yaml"):
        read = load_robot(tmp_path / name)
        assert read.joint_names[0] == "shoulder_pan_joint"
        for q in np.random.default_rng(2).uniform(-3, 3, (4, 6)):
            stand = robot.chain.forward(robot.theta(q[None]), off)
            found = flange(read, q) @ behind
            np.testing.assert_allclose(found[:3, 3], stand.x[:, 0], atol=1e-9)
            np.testing.assert_allclose(found[:3, :3], stand.R[:, :, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kinematics: {}", "holds no origins of joints"),
        ("kinematics:\n  a: {x: 0, y: 0, z: 1, roll: 0, pitch: 0}", "a needs the six numbers x, y, z, roll"),
        ("kinematics:\n  a: {x: 0, y: 0, z: 1, roll: 0, pitch: 0, yaw: 0, w: 1}", "a needs the six numbers"),
        ("kinematics:\n  a: {x: 0, y: 0, z: 1, roll: 90, pitch: 0, yaw: 0}", "looks like degrees"),
        ("[1, 2]", "holds no origins"),
        ("a: [", "cannot be read as YAML"),
    ],
)
def test_origins_that_are_not_understood_are_refused(tmp_path, text, said):
    (tmp_path / "arm.yaml").write_text(text)
    with pytest.raises(InputError, match=said):
        load_robot(tmp_path / "arm.yaml")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize(("sign", "decimal"), [(";", ","), ("\t", ","), (";", "."), ("\t", "."), (",", ".")])
def test_tables_of_spreadsheets_are_read(sign, decimal, encoding, tmp_path):
    rows = ["alpha_deg,a_mm,theta_deg,d_mm", "90,0,0,162.5", "0,-425.25,0,0", "0,-392.2,0,0", "90,0,0,133.3"]
    text = "\n".join(["# convention: dh", *rows, "-90,0,0,99.7", "0,0,0,99.6", ""])
    (tmp_path / "plain.csv").write_text(text)
    (tmp_path / "arm.csv").write_bytes(text.replace(",", sign).replace(".", decimal).encode(encoding))
    plain, found = (load_robot(str(tmp_path / name)) for name in ("plain.csv", "arm.csv"))
    assert [(t.kind, t.nominal) for t in found.transforms] == [(t.kind, t.nominal) for t in plain.transforms]
    assert -0.42525 in [t.nominal for t in found.transforms]
