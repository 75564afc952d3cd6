"""The shipped robots against published poses, and URDF robots against pinocchio's own reader."""

import re

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.motion.collision.engines import pin_model
from tests.not_everywhere import pin

TOPICS = ("kinematics", "limits", "speeds", "accelerations", "jerks", "bodies")

URDF = """<robot name="six"><link name="base"/>{links}{joints}</robot>"""


def urdf_text(axes, mesh=None):
    links, joints = "", ""
    for i, axis in enumerate(axes, 1):
        shape = f'<mesh filename="{mesh}"/>' if mesh else '<cylinder radius="0.05" length="0.3"/>'
        links += (
            f'<link name="l{i}"><inertial><mass value="{i}"/><origin xyz="0.01 0.02 {0.1 * i}"/>'
            '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
            f'<collision><origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/><geometry>{shape}</geometry></collision></link>'
        )
        parent = "base" if i == 1 else f"l{i - 1}"
        joints += (
            f'<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="0.1 {0.05 * i} 0.2" rpy="{0.3 * i} 0.2 -0.5"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2.5" velocity="2" effort="1"/></joint>'
        )
    tip = f'<link name="tip"/><joint name="fix" type="fixed"><parent link="l{len(axes)}"/><child link="tip"/>'
    return URDF.format(links=links, joints=joints + tip + '<origin xyz="0 0.1 0.2" rpy="0.4 0 0"/></joint>')


@pytest.mark.parametrize("name", list_robots())
def test_every_robot_gives_its_sources(name):
    robot = load_robot(name)
    topics = " ".join(topic for topic, _ in robot.sources)
    assert all(topic in topics for topic in TOPICS), topics
    assert robot.bodies
    assert (robot.q_lower < robot.q_upper).all()


@pytest.mark.parametrize(
    ("name", "q_deg", "flange_mm"),
    [
        ("kuka-kr6-r700", [0, -90, 90, 0, 0, 0], [470, 0, 750]),  # KUKA's home, data sheet dimensions
        ("abb-irb120", [0] * 6, [374, 0, 630]),  # ABB product specification
        ("abb-irb6700", [0] * 6, [1782.5, 0, 2125]),
        ("ur10", [0] * 6, [-1184.3, -256.141, 11.6]),  # Universal Robots' DH table
        ("comau-nj130", [0] * 6, [1371.58, 0, 1620]),  # upper arm up, forearm level
    ],
)
def test_published_poses(name, q_deg, flange_mm):
    robot = load_robot(name)
    x = robot.chain.forward(robot.theta(np.deg2rad([q_deg]))).x[:, 0]
    np.testing.assert_allclose(x * 1e3, flange_mm, atol=0.01)


@pytest.mark.parametrize(
    "axes", [["0 0 1"] * 6, ["1 0 0", "0 -1 0", "0 0 1", "0 1 0", "-1 0 0"], ["0.6 0 0.8", "0 1 1", *["0 0 1"] * 5]]
)
def test_urdf_agrees_with_pinocchio(tmp_path, axes):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(axes))
    robot = load_robot(str(path), tip="tip")
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    frame = model.getFrameId("tip")
    q = np.random.default_rng(0).uniform(-2, 2, (20, len(axes)))
    motion = robot.chain.forward(robot.theta(q))
    for k in range(20):
        pin.framesForwardKinematics(model, data, q[k])
        np.testing.assert_allclose(motion.x[:, k], data.oMf[frame].translation, atol=1e-9)
        np.testing.assert_allclose(motion.R[:, :, k], data.oMf[frame].rotation, atol=1e-9)
    assert [m.mass for m in robot.masses] == pytest.approx(range(1, len(axes) + 1))
    ours, _ = pin_model(robot)
    gravity = pin.computeGeneralizedGravity(ours, ours.createData(), robot.theta(q[:1])[0])
    theirs = pin.computeGeneralizedGravity(model, data, q[0])
    np.testing.assert_allclose(robot.coupling_matrix.T @ gravity, theirs, atol=1e-9)


def test_coupling_and_sense_follow_the_contract(tmp_path):
    text = (load_robot("comau-nj130").path).read_text()
    head, *joints = text.split("[[joints]]")
    joints[2] = (
        joints[2].replace("sense = 1", "sense = -1\ncouple = { 2 = 0.5 }").replace("zero_deg = 0", "zero_deg = 10")
    )
    path = tmp_path / "robot.toml"
    path.write_text("[[joints]]".join([head, *joints]))
    q = np.deg2rad([[1.0, 20.0, 30.0, 4.0, 5.0, 6.0]])
    theta = load_robot(str(path)).theta(q)
    np.testing.assert_allclose(np.rad2deg(theta), [[1.0, 20.0, -(30.0 - 10.0 + 0.5 * 20.0), 4.0, 5.0, 6.0]])


def changed(tmp_path, old, new, count=1):
    path = tmp_path / "robot.toml"
    text = load_robot("comau-nj130").path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("limit_deg = [-180, 180]", "limit_deg = [-3.1, 3.1]", ["radians", "[[joints]] number 1: 'limit_deg'"]),
        ("limit_deg = [-180, 180]", "limit_deg = [180, -180]", ["lower limit"]),
        ("speed_deg_s = 110", "speed_deg_s = 0", ["speed_deg_s", "greater than 0"]),
        ("speed_deg_s = 110", "speed_deg_s = -5", ["speed_deg_s", "greater than 0"]),
        ("acceleration_deg_s2 = 440", "acceleration_deg_s2 = nan", ["acceleration_deg_s2", "finite"]),
        ("a_mm = 400.0", "a_m = 0.4", ["a_m", "a_mm"]),
        ("alpha_deg = -90\n", "", ["alpha_deg", "joint 1"]),
        ("link = 5", "link = 9", ["link 9", "6"]),
        ('kind = "capsule"', 'kind = "mesh"\nfile = "gone.stl"', ["from_mm", "gone.stl"]),
    ],
)
def test_a_wrong_robot_file_is_refused_with_the_key(tmp_path, old, new, words):
    with pytest.raises(InputError) as err:
        load_robot(changed(tmp_path, old, new))
    assert any(w in str(err.value) for w in words), str(err.value)


def test_a_joint_count_that_is_not_supported_is_refused(tmp_path):
    text = load_robot("comau-nj130").path.read_text()
    head, *rest = text.split("[[joints]]")
    path = tmp_path / "robot.toml"
    path.write_text("[[joints]]".join([head.split("never_meet")[0] + head[head.index("[sources]") :], *rest[:3]]))
    with pytest.raises(InputError, match="3 joints found"):
        load_robot(str(path))


AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
SENSELESS = {  # of a URDF: what is written, what stands there instead, what is told
    "degrees": ('lower="-2" upper="2.5"', 'lower="-180" upper="180"', "'j1': lower = -180 .* are these degrees"),
    "mimic": ('effort="1"/>', 'effort="1"/><mimic joint="j2"/>', "'j1' is moved by joint 'j2' .<mimic>."),
    "two links": ('<link name="l2">', '<link name="l3"/><link name="l2">', "two links are called 'l3'"),
    "two joints": ('name="j2"', 'name="j3"', "two joints are called 'j3'"),
    "two parents": ('<child link="l2"', '<child link="l3"', "two joints have the child 'l3'"),
    "ring": ('<parent link="base"', '<parent link="l3"', "the links l. < l. < l. < l. form a ring"),
}


@pytest.mark.parametrize("case", SENSELESS)
def test_a_urdf_that_describes_no_arm_is_told_by_name(tmp_path, case):
    old, new, said = SENSELESS[case]
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(AXES).replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        load_robot(str(path), tip="tip")


def test_an_unknown_robot_names_the_nearest():
    with pytest.raises(InputError, match="comau-nj130"):
        load_robot("comau-nj13")


def test_a_urdf_with_joints_that_do_not_match_its_rows(tmp_path):
    (tmp_path / "robot.urdf").write_text(urdf_text(["0 0 1"] * 6))
    joint = "[[joints]]\nlimit_deg=[-100,100]\nspeed_deg_s=100\nacceleration_deg_s2=100\njerk_deg_s3=1000\n"
    path = tmp_path / "robot.toml"
    path.write_text('schema="edbb-robot/1"\nname="x"\nconvention="urdf"\nurdf="robot.urdf"\ntip="tip"\n' + 5 * joint)
    with pytest.raises(InputError, match=r"5 \[\[joints\]\] tables, but the chain of the URDF has 6"):
        load_robot(str(path))


def test_a_robot_for_identification_needs_no_limits_but_planning_says_which_is_missing(tmp_path):
    text = (data_folder("robots") / "ur10" / "robot.toml").read_text()
    bare = re.sub(r"(?m)^(limit_deg|speed_deg_s|acceleration_deg_s2|jerk_deg_s3) = .*\n", "", text)
    (tmp_path / "bare.toml").write_text(bare)
    robot = load_robot(str(tmp_path / "bare.toml"))
    assert np.isinf(robot.speed).all()
    cell = tmp_path / "cell.toml"
    cell.write_text('schema = "edbb-cell/1"\nrobot = "bare.toml"\n[gauge]\nkind = "tracker"\n')
    assert load_cell(str(cell), planning=False).robot.n_joints == 6
    cell.write_text(
        'schema = "edbb-cell/1"\nrobot = "bare.toml"\nhome_deg = [0, -90, 90, -90, -90, 0]\n'
        "[tool]\nmap_mm = [50, 0, 120]\n"
        '[gauge]\nkind = "edbb"\nlength_mm = [300, 520]\n[[fixtures]]\nposition_mm = [600, 500, 60]\n'
    )
    with pytest.raises(InputError, match="joints 1, 2, 3, 4, 5, 6 have no limit_deg and no speed_deg_s, which"):
        load_cell(str(cell))


def test_accelerations_and_jerks_that_nobody_gave_are_estimated_alike_from_every_file(tmp_path):
    row = "alpha_deg = {alpha}\na_mm = 200\nd_mm = 100\ntheta_deg = 0\nlimit_deg = [-180, 180]\nspeed_deg_s = 100\n"
    head = 'schema = "edbb-robot/1"\nname = "x"\nconvention = "mdh"\n'
    rows = ["[[joints]]\n" + row.format(alpha=90 * (i % 2)) for i in range(6)]
    toml, table, urdf = (tmp_path / name for name in ("bare.toml", "bare.csv", "bare.urdf"))
    toml.write_text(head + "".join(rows))
    table.write_text(
        "# convention: mdh\nalpha_deg,a_mm,theta_deg,d_mm,lower_deg,upper_deg,speed_deg_s\n"
        + "".join(f"{90 * (i % 2)},200,0,100,-180,180,100\n" for i in range(6))
    )
    urdf.write_text(urdf_text(["0 0 1", "1 0 0"] * 3).replace('velocity="2"', f'velocity="{np.deg2rad(100)!s}"'))
    for path in (toml, table, urdf):
        robot = load_robot(str(path), tip="tip" if path is urdf else None)
        np.testing.assert_allclose(np.rad2deg(robot.acceleration), 400)
        np.testing.assert_allclose(np.rad2deg(robot.jerk), 1600)
        assert dict(robot.sources)["accelerations, jerks"] == "estimated: 0.25 s to full speed"
    toml.write_text(head + rows[0] + "acceleration_deg_s2 = 250\n" + "".join(rows[1:]) + '[sources]\njerks = "own"\n')
    robot = load_robot(str(toml))
    np.testing.assert_allclose(np.rad2deg(robot.jerk), [1000, *5 * [1600]])
    assert dict(robot.sources) == {"accelerations": "estimated: 0.25 s to full speed", "jerks": "own"}
