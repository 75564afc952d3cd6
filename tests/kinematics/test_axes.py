"""How controllers count axes: the shipped tables against the makers' own descriptions, and the rule itself."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.kinematics.robot_reader import list_robots, load_robot
from tests.not_everywhere import pin

ARMS = tomllib.loads((Path(__file__).parent / "makers.toml").read_text())["arm"]
NAMES = [f"{a['robot']} {a['controller']}" for a in ARMS]
BY_DIALECT = {"poses-csv", "poses-json"}  # lists that hold the model's own angles


def pose(x, y, z, roll, pitch, yaw):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=True).as_matrix()
    T[:3, 3] = x, y, z
    return T


def turn(axis, angle):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.asarray(axis, dtype=float) * angle).as_matrix()
    return T


def makers_joints(arm, c):
    """Frames of the joints (the axis is z, or as said) and of the flange at the maker's angles c [rad], in mm."""
    T, joints = np.eye(4), []
    if "rows" in arm:
        for (alpha, a, d, theta, sense), angle in zip(arm["rows"], c, strict=True):
            T = T @ pose(a, 0, 0, alpha, 0, 0) @ pose(0, 0, d, 0, 0, theta) @ turn([0, 0, 1], sense * angle)
            joints.append(T @ np.diag([1, sense, sense, 1.0]))
        return joints, T @ pose(0, 0, 0, *arm["flange_deg"])
    axes = arm.get("axis", [[0, 0, 1]] * len(c))
    for origin, axis, angle in zip(arm["origins"], axes, c, strict=False):
        T = T @ pose(*origin) @ turn(axis, angle)
        joints.append(T)
    return joints, T @ pose(*arm["origins"][-1])


def models_flange(robot, q):
    motion = robot.chain.forward(robot.theta(q[None]))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = motion.R[:, :, 0], motion.x[:, 0] * 1e3
    return T


def strokes(arm):
    return np.array(arm["limit_rad"]) if "limit_rad" in arm else np.deg2rad(arm["limit_deg"])


def test_every_shipped_robot_has_a_table_of_its_makers_axes():
    assert {a["robot"] for a in ARMS} == set(list_robots())
    for name in list_robots():
        dialect = load_robot(name).dialect
        assert dialect in BY_DIALECT or load_robot(name).axes_of(dialect).source


@pytest.mark.parametrize("arm", ARMS, ids=NAMES)
def test_the_arm_stands_where_the_maker_says_at_the_makers_angles(arm):
    robot = load_robot(arm["robot"])
    axes, limit = robot.axes_of(arm["controller"]), strokes(arm)
    rng = np.random.default_rng(3)
    for c in rng.uniform(*limit.T, (40, robot.n_joints)):
        made, said = models_flange(robot, axes.to_model(c)), makers_joints(arm, c)[1]
        np.testing.assert_allclose(made[:3, 3], said[:3, 3], atol=0.006)  # SO-101: rounded angles of its URDF
        np.testing.assert_allclose(made[:3, :3], said[:3, :3], atol=3e-5)


@pytest.mark.parametrize("arm", ARMS, ids=NAMES)
def test_zero_and_strokes_are_the_makers(arm):
    robot = load_robot(arm["robot"])
    axes = robot.axes_of(arm["controller"])
    zero = models_flange(robot, axes.to_model(np.zeros(robot.n_joints)))
    np.testing.assert_allclose(zero[:3, 3], arm["zero_mm"], atol=0.05)
    np.testing.assert_allclose(np.stack([axes.lower, axes.upper], axis=1), strokes(arm), atol=2e-4)
    ends = np.stack([robot.q_lower, robot.q_upper])
    assert axes.is_within(axes.to_controller(ends)).all()


def test_comaus_axes_turn_the_way_they_turn_in_a_second_source():
    """Senses of the UKAEA driver's URDF: where each axis points as the forearm lies, seen in the base."""
    arm = ARMS[0]
    robot = load_robot(arm["robot"])
    axes, level = robot.axes_of("pdl2"), np.deg2rad(arm["level_deg"])
    step = 1e-6
    for j, direction in enumerate(arm["axes_at_level"]):
        more = level + step * np.eye(6)[j]
        R = models_flange(robot, axes.to_model(more))[:3, :3] @ models_flange(robot, axes.to_model(level))[:3, :3].T
        np.testing.assert_allclose(Rotation.from_matrix(R).as_rotvec() / step, direction, atol=1e-4)


HEAD = 'schema = "edbb-robot/1"\nname = "six"\nconvention = "dh"\n'
JOINT = (
    "[[joints]]\nalpha_deg = 90\na_mm = 100\nd_mm = 50\ntheta_deg = 0\nlimit_deg = [-100, 120]\nspeed_deg_s = 90\n"
    "acceleration_deg_s2 = 300\njerk_deg_s3 = 3000\n"
)
FANUC = """[controllers.fanuc-tp]
sense = [-1, 1, 1, 1, -1, 1]
zero_deg = [0, 90, -12.5, 0, 0, 180]
coupling = [[3, 2, -1]]
limit_deg = [[-120, 120], [-10, 210], [-300, 200], [-100, 120], [-120, 100], [80, 300]]
source = "drawn for the test"
"""


def six(tmp_path, controllers):
    path = tmp_path / "robot.toml"
    path.write_text(HEAD + controllers + 6 * JOINT)
    return load_robot(str(path))


def test_sense_zero_and_coupling_by_hand(tmp_path):
    axes = six(tmp_path, FANUC).axes_of("fanuc-tp")
    # J2 = 20 + 90; J3 = 30 - 12.5 - J2
    assert axes.degrees_to_controller((10.0, 20.0, 30.0, 40.0, 50.0, 60.0)) == (-10.0, 110.0, -92.5, 40.0, -50.0, 240.0)
    assert axes.sentences([f"J{j}" for j in range(1, 7)])[1:4] == (
        "J2 = q2 + 90 deg",
        "J3 = q3 - q2 - 102.5 deg",
        "J4 = q4",
    )
    # as J2 alone is jogged the forearm keeps its direction: joint 3 takes back what joint 2 turns
    still, jogged = (np.rad2deg(axes.to_model(np.deg2rad(c))) for c in ([0, 100, 5, 0, 0, 180], [0, 110, 5, 0, 0, 180]))
    np.testing.assert_allclose(jogged - still, [0, 10, 10, 0, 0, 0], atol=1e-12)


def test_to_the_controller_and_back_is_exact_in_batches_and_in_printed_decimals(tmp_path):
    axes, rng = six(tmp_path, FANUC).axes_of("fanuc-tp"), np.random.default_rng(0)
    q = rng.uniform(-3, 3, (500, 6))
    np.testing.assert_allclose(axes.to_model(axes.to_controller(q)), q, atol=1e-14)
    for row in np.round(rng.uniform(-180, 180, (500, 6)), 4).tolist():
        there = axes.degrees_to_controller(row)
        assert all(value == round(value, 4) for value in there)
        assert axes.degrees_to_model(there) == tuple(row)


def test_work_is_the_same_in_both_axes(tmp_path):
    axes, rng = six(tmp_path, FANUC).axes_of("fanuc-tp"), np.random.default_rng(1)
    torque, dq = rng.normal(size=(20, 6)), rng.normal(size=(20, 6))
    dc = axes.to_controller(dq) - axes.to_controller(np.zeros((1, 6)))
    np.testing.assert_allclose((axes.torque_to_model(torque) * dq).sum(axis=1), (torque * dc).sum(axis=1))


def test_a_robot_in_the_axes_of_its_controller_is_the_same_arm(tmp_path):
    robot = six(tmp_path, FANUC)
    axes = robot.axes_of("fanuc-tp")
    there, q = robot.in_axes(axes), np.random.default_rng(2).uniform(-2, 2, (30, 6))
    c = axes.to_controller(q)
    np.testing.assert_allclose(there.chain.forward(there.theta(c)).x, robot.chain.forward(robot.theta(q)).x, atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(there.q_lower), [-120, -10, -300, -100, -120, 80])
    np.testing.assert_allclose(np.rad2deg(there.speed), [90] * 6)


def test_a_controller_of_which_the_file_says_nothing_is_refused_with_the_lines_to_add(tmp_path):
    with pytest.raises(InputError) as err:
        six(tmp_path, FANUC).axes_of("krl")
    said = str(err.value)
    assert all(w in said for w in ("robot.toml", "'krl'", "fanuc-tp", "[controllers.krl]", "same = true", "source = "))
    added = "\n".join(line.strip() for line in said.splitlines()[1:5]).replace("or, where", "#")
    with pytest.raises(InputError, match=r"(?s)krl.*source still says <date>.*2026-03-02"):
        six(tmp_path, FANUC + added + "\n")  # copied as it stands: nobody has jogged anything
    added = added.replace("<date>", "2026-03-02")
    assert six(tmp_path, FANUC + added + "\n").axes_of("krl").is_same


WRONG = {
    "too few": ("sense = [-1, 1, 1, 1, -1, 1]", "sense = [-1, 1]", "sense has 2 values, the robot has 6 joints"),
    "sense": ("sense = [-1,", "sense = [2,", "sense"),
    "both": ("coupling", "same = true\ncoupling", "same = true leaves no room"),
    "ring": ("[[3, 2, -1]]", "[[3, 2, -1], [2, 3, 1]]", "in a ring"),
    "itself": ("[[3, 2, -1]]", "[[3, 3, -1]]", "two different axes of 1 to 6"),
    "axis 7": ("[[3, 2, -1]]", "[[7, 2, -1]]", "two different axes of 1 to 6"),
    "no source": ('source = "drawn for the test"\n', "", "source"),
    "zero": ("zero_deg = [0, 90,", "zero_deg = [0, 1e6,", "zero_deg.*720"),
    "factor": ("[[3, 2, -1]]", "[[3, 2, 1e6]]", "coupling.*10"),
    "placeholder": ("drawn for the test", "jogged by <name>, today", "source still says <name>"),
    "quick": ("source", "speed_deg_s = [90, 90, 90, 90, 90, 1900]\nsource", "speed_deg_s of axis 6 is 1900.* it is 90"),
    "slow": ("source", "speed_deg_s = [90, 4, 90, 90, 90, 90]\nsource", "speed_deg_s of axis 2 is 4"),
    "stroke": ("coupling = [[3, 2, -1]]\nlimit_deg = [[-120, 120]", "limit_deg = [[-90, 120]", r"limit_deg of axis 1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_table_is_refused_with_its_key(tmp_path, case):
    old, new, said = WRONG[case]
    assert old in FANUC
    with pytest.raises(InputError, match=said) as err:
        six(tmp_path, FANUC.replace(old, new))
    assert "robot.toml" in str(err.value)
    assert "fanuc-tp" in str(err.value)


def test_a_calibrated_robot_keeps_its_tables(tmp_path):
    from planner.kinematics.robot_writer import RobotCorrections, write_robot

    robot = load_robot("comau-nj130")
    made = write_robot(robot, RobotCorrections((("a2", 0.861),), (), None, "a fit."))
    (tmp_path / "robot.toml").write_text(dict(made)["robot.toml"])
    again = load_robot(str(tmp_path / "robot.toml")).axes_of("pdl2")
    np.testing.assert_array_equal(again.matrix, robot.axes_of("pdl2").matrix)
    np.testing.assert_array_equal(again.zero, robot.axes_of("pdl2").zero)


EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_urdf_alone_is_known_to_ros_and_to_no_other_controller():
    robot = load_robot(str(EXAMPLES / "arm.urdf"), tip="flange")
    assert robot.axes_of("ros2-trajectory").is_same
    with pytest.raises(
        InputError, match=r'(?s)\[controllers\.rapid\].*convention = "urdf".*urdf = "arm\.urdf".*"flange"'
    ):
        robot.axes_of("rapid")


def test_joints_of_a_urdf_are_ros_joints_whatever_the_model_calls_them(tmp_path):
    """A robot.toml may count the joints of its URDF otherwise; pinocchio reads the URDF itself."""
    path = EXAMPLES / "arm.urdf"
    joint = "[[joints]]\nsense = {}\nzero_deg = {}\nlimit_deg = [-90, 90]\nspeed_deg_s = 100\n"
    joints = "".join(joint.format(s, z) for s, z in ((-1, 10), (1, 0), (1, -20), (-1, 0), (1, 5), (-1, 0)))
    text = f'schema = "edbb-robot/1"\nname = "arm"\nconvention = "urdf"\nurdf = "{path}"\ntip = "flange"\n'
    (tmp_path / "robot.toml").write_text(text + joints)
    robot = load_robot(str(tmp_path / "robot.toml"))
    axes, model = robot.axes_of("ros2-trajectory"), pin.buildModelFromUrdf(str(path))
    assert not axes.is_same
    data, frame = model.createData(), model.getFrameId("flange")
    for c in np.random.default_rng(4).uniform(-1, 1, (10, 6)):
        pin.framesForwardKinematics(model, data, c)
        made = models_flange(robot, axes.to_model(c))
        np.testing.assert_allclose(made[:3, 3] / 1e3, data.oMf[frame].translation, atol=1e-9)
        np.testing.assert_allclose(made[:3, :3], data.oMf[frame].rotation, atol=1e-9)
