"""Whatever a URDF says that moves or limits something is read or refused: attributes, elements, units."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.angle_units import degrees_text
from planner.kinematics.bodies import mesh_unit
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import RobotCorrections, write_robot
from planner.motion.collision.scene import mesh_faces
from tests.command import edbb
from tests.identification.few_draws import few_draws
from tests.not_everywhere import pin

JOINT = """
  <joint name="j{k}" type="revolute">
    <parent link="l{k}"/><child link="l{next}"/>
    <origin xyz="0.05 0.01 0.2" rpy="0.1 0.2 {k}e-1"/><axis xyz="0 {y} {z}"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/>
  </joint>"""
ROUND = '<collision><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>'
LIMIT = '<limit lower="-2" upper="2" velocity="1" effort="1"/>'


def arm() -> str:
    links = "".join(f'\n  <link name="l{k}">{ROUND}</link>' for k in range(7))
    joints = "".join(JOINT.format(k=k, next=k + 1, y=k % 2, z=1 - k % 2) for k in range(6))
    return f'<robot name="arm">{links}{joints}\n</robot>'


def load(folder: Path, text: str):
    (folder / "arm.urdf").write_text(text)
    return load_robot(folder / "arm.urdf")


def with_limit(text: str, attributes: str, after: str = "") -> str:
    """Return the arm whose joint 2 says more of its limits."""
    return re.sub(
        r'(name="j2".*?)' + re.escape(LIMIT), rf"\g<1>{LIMIT[:-2]} {attributes}/>{after}", text, count=1, flags=re.S
    )


@pytest.mark.parametrize("seed", range(4))
def test_an_origin_by_quaternion_stands_where_pinocchio_has_it_by_angles(tmp_path, seed):
    rng = np.random.default_rng(seed)
    turns = [rng.uniform(-1.5, 1.5, 3) for _ in range(6)]
    by_angles, by_quaternion = arm(), arm().replace('name="arm"', 'name="arm" version="1.1"')
    for k, turn in enumerate(turns):
        old = f'rpy="0.1 0.2 {k}e-1"'
        quaternion = Rotation.from_euler("xyz", turn).as_quat()
        by_angles = by_angles.replace(old, f'rpy="{" ".join(map(repr, map(float, turn)))}"')
        by_quaternion = by_quaternion.replace(old, f'quat_xyzw="{" ".join(map(repr, map(float, quaternion)))}"')
    robot, model = load(tmp_path, by_quaternion), pin.buildModelFromXML(by_angles)
    data = model.createData()
    for q in rng.uniform(-2, 2, (5, 6)):
        pin.framesForwardKinematics(model, data, q)
        x = robot.chain.forward(robot.theta(q[None])).x[:, 0]
        np.testing.assert_allclose(x, data.oMf[model.getFrameId("l6")].translation, atol=1e-12)
    found = RobotCorrections((("x3", 0.06),), (), None, "by hand")
    written = dict(write_robot(robot, found))["robot.urdf"]
    (tmp_path / "new.urdf").write_text(written)
    turned = load_robot(tmp_path / "new.urdf").chain.forward(robot.theta(np.zeros((1, 6)))).R
    np.testing.assert_allclose(turned, robot.chain.forward(robot.theta(np.zeros((1, 6)))).R, atol=1e-12)


@pytest.mark.parametrize(
    ("attributes", "after", "acceleration", "jerk", "upper"),
    [
        ('acceleration="1.5" jerk="5"', "", 1.5, 5.0, 2.0),
        ('acceleration="1.5" deceleration="1.2"', "", 1.2, None, 2.0),
        ('deceleration="1.2" acceleration="inf"', "", 1.2, None, 2.0),
        ('drake:acceleration="0.7"', "", 0.7, None, 2.0),
        ("", '<safety_controller soft_lower_limit="-1.8" soft_upper_limit="1.7" k_velocity="9"/>', None, None, 1.7),
        ("", '<safety_controller soft_lower_limit="-9" soft_upper_limit="9" k_velocity="9"/>', None, None, 2.0),
        ("", '<safety_controller k_velocity="9"/>', None, None, 2.0),
    ],
)
def test_what_limits_a_joint_is_read(tmp_path, attributes, after, acceleration, jerk, upper):
    plain, robot = load(tmp_path, arm()), load(tmp_path, with_limit(arm(), attributes, after))
    assert robot.q_upper[2] == pytest.approx(upper)
    assert robot.acceleration[2] == pytest.approx(acceleration or plain.acceleration[2])
    expected = jerk or (robot.acceleration[2] / 0.25)
    assert robot.jerk[2] == pytest.approx(expected)
    others = [0, 1, 3, 4, 5]
    assert robot.acceleration[others] == pytest.approx(plain.acceleration[others])


REFUSED = [  # what stands in the file, what instead, and what the message says beside the line
    ('<origin xyz="0.05 0.01 0.2" rpy="0.1 0.2 3e-1"/>', '<origin xyz="0 0 0.2" quat_wxyz="1 0 0 0"/>', "quat_wxyz"),
    ('rpy="0.1 0.2 3e-1"', 'rpy="0 0 0" quat_xyzw="0 0 0 1"', "both rpy and quat_xyzw"),
    ('rpy="0.1 0.2 3e-1"', 'quat_xyzw="0 0 90 1"', "has the length 90"),
    ('rpy="0.1 0.2 3e-1"', 'rpy="0 90 0"', "looks like degrees"),
    ('rpy="0.1 0.2 3e-1"', 'rpy="0 0 4.5"', "looks like degrees"),
    ('rpy="0.1 0.2 3e-1"', 'rpy_deg="0 4 0"', "'rpy_deg', which is not read"),
    ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0" rpy="0 0 1"/>', "<axis> of joint 'j1' has the attribute 'rpy'"),
    ('velocity="1"', 'velocity="1" torque_rate="3"', "'torque_rate', which is not read"),
    ('velocity="1"', 'velocity="1" jerk="-3"', "jerk = -3 is negative"),
    ('<child link="l4"/>', '<child link="l4"/><Limit upper="1"/>', "<Limit>, which is not read; did you mean"),
    ('<child link="l4"/>', '<child link="l4"/><offset xyz="0 0 1"/>', "<offset>, which is not read"),
    ('<child link="l4"/>', '<child link="l4"/><axis xyz="1 0 0"/>', "second <axis>"),
    ('<child link="l4"/>', '<child link="l4"/><drake:mimic joint="j1"/>', "<drake:mimic>, which is not read"),
    ('<child link="l4"/>', '<child link="l4"/><mimic joint="j1" ratio="2"/>', "'ratio', which is not read"),
    ('<joint name="j3" type="revolute">', '<joint name="j3" type="hinge">', "type 'hinge': URDF has revolute"),
    ('<link name="l3">', '<link name="l3"><origin xyz="0 0 1"/>', "<origin>, which is not read"),
    ("<cylinder radius", '<ellipsoid a="1"/><cylinder radius', "<ellipsoid>, which is not read"),
    ("<cylinder radius", '<sphere radius="1"/><cylinder radius', "several shapes"),
    ("<cylinder radius", '<cylinder rpy="0 1 0" radius', "'rpy', which is not read"),
    ('<link name="l3">', '<loop_joint><origin/></loop_joint><link name="l3">', "<loop_joint>, which is not read"),
    ('<link name="l3">', '<Joint name="x"/><link name="l3">', "<Joint>, which is not read"),
    ('<link name="l3">', '<drake:joint name="x"/><link name="l3">', "<drake:joint>, which is not read"),
]


@pytest.mark.parametrize(("there", "instead", "said"), REFUSED, ids=[r[1] for r in REFUSED])
def test_what_may_move_or_limit_and_is_not_read_is_refused_with_its_line(tmp_path, there, instead, said):
    text = arm()
    assert there in text
    text = text.replace(there, instead, 1)
    with pytest.raises(InputError, match=re.escape(said)) as told:
        load(tmp_path, text)
    (number,) = re.findall(r"arm\.urdf, line (\d+): ", str(told.value))
    line = 1 + text[: text.index(instead)].count("\n")
    assert abs(int(number) - line) <= 2  # the element that holds it may begin before, the second of two stand after


@pytest.mark.parametrize(
    ("there", "more"),
    [
        ('<link name="l3">', '<gazebo reference="l3"><limit lower="0"/></gazebo><transmission name="t"/>'),
        ('<link name="l3">', '<ros2_control name="r"><joint name="j1"><limit/></joint></ros2_control>'),
        ('<link name="l3">', '<link name="l3"><drake:extra/><visual><origin xyz="0 0 1" wobble="1"/></visual>'),
        ('<link name="l3">', '<origin_of_file by="me"/><material name="red"/>'),
        ('<child link="l4"/>', '<dynamics D="1" K="7000" damping="0.003" mu_coulomb="0"/><calibration rising="0"/>'),
        ('<child link="l4"/>', '<drake:rotor_inertia value="1"/><gazebo/><hardwareInterface/>'),
    ],
)
def test_what_moves_nothing_is_passed_over(tmp_path, there, more):
    extra = more if more.startswith("<link") else more + there
    robot = load(tmp_path, arm().replace(there, extra, 1).replace("<robot ", '<robot xmlns:xacro="x" ', 1))
    plain = load(tmp_path, arm())
    assert robot.transforms == plain.transforms


@pytest.mark.parametrize(
    ("angles", "radians"),
    [
        ((0, 90, 0), False), ((5, 0, 0), False), ((-4.5, 0, 0), False), ((0, 33.7, 0), False), ((180, 0, 0), False),
        ((1.5707963, 0, 3.14159), True), ((4.71239, 0, -6.2832), True), ((7.853982, 0, 0), True),
        ((3.0, 1.0, 2.0), True), ((4.7518, 5.2013, 6.2), False), ((4.7518, 5.2013, 6.23), True),
    ],
)  # fmt: skip
def test_radians_that_are_degrees(angles, radians):
    assert (degrees_text(angles) == "") == radians


def collada(path: Path, unit: str, up: str = "Z_UP") -> Path:
    corners = "0 0 0 200 0 0 0 60 0 0 0 40"
    path.write_text(
        f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{unit}<up_axis>{up}'
        '</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="12">'
        f"{corners}</float_array><technique_common>"
        '<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>'
        '<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input '
        'semantic="POSITION" source="#p"/></vertices><triangles count="4"><input semantic="VERTEX" source="#v" '
        'offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>'
        '<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    return path


@pytest.mark.parametrize(
    ("unit", "up", "metres"),
    [('<unit name="mm" meter="0.001"/>', "Z_UP", 1e-3), ('<unit meter="0.0254"/>', "Y_UP", 0.0254), ("", "X_UP", 1.0)],
)
def test_a_collada_mesh_is_read_in_its_unit_and_not_turned_by_its_up_axis(tmp_path, unit, up, metres):
    """As RViz and Gazebo do: the unit counts, the axis that points up does not."""
    file = collada(tmp_path / "wedge.dae", unit, up)
    assert mesh_unit(file) == metres
    shape = '<mesh filename="wedge.dae" scale="0.5 0.5 0.5"/>'
    robot = load(tmp_path, arm().replace('<cylinder radius="0.03" length="0.1"/>', shape, 1))
    (body,) = [b for _, b in robot.bodies if b.kind == "mesh"]
    vertices = mesh_faces(body)[0]
    np.testing.assert_allclose(np.ptp(vertices, axis=0), 0.5 * metres * np.array([200, 60, 40]), rtol=1e-6)


def test_a_unit_that_is_no_length_is_refused(tmp_path):
    with pytest.raises(InputError, match='<unit meter="mm">: a length in metres is needed'):
        mesh_unit(collada(tmp_path / "wedge.dae", '<unit meter="mm"/>'))


@pytest.mark.slow
def test_a_mesh_that_is_missing_stops_plans_and_no_identification(tmp_path):
    text = arm().replace('<cylinder radius="0.03" length="0.1"/>', '<mesh filename="package://arm/base.stl"/>', 1)
    robot = load(tmp_path, text)
    cell = tmp_path / "cell.toml"
    cell.write_text(
        'schema = "edbb-cell/1"\nrobot = "arm.urdf"\nhome_deg = [0, -30, 60, 0, 45, 0]\n[tool]\nmap_mm = [20, 0, 30]\n'
        '[gauge]\nkind = "draw-wire"\nlength_mm = [200, 1200]\n[[fixtures]]\nposition_mm = [500, 400, 80]\n'
    )
    assert len(load_cell(cell, planning=False).robot.bodies) == 6
    with pytest.raises(InputError, match=r"mesh 'package://arm/base.stl' of link 'l0' does not exist.*--package arm="):
        load_cell(cell)
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    stand = robot.chain.forward(robot.theta(q))
    x = stand.x.T + np.einsum("ijn,j->ni", stand.R, [0.02, 0.01, 0.1])
    rows = [",".join(f"{v:.6f}" for v in (*np.rad2deg(a), *(1e3 * p))) for a, p in zip(q, x, strict=True)]
    head = ",".join([*(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"])
    (tmp_path / "run.csv").write_text("\n".join([head, *rows]))
    cell.write_text('schema = "edbb-cell/1"\nrobot = "arm.urdf"\n[gauge]\nkind = "tracker"\nnoise_um = 20\n')
    with few_draws():
        done = edbb("identify", str(tmp_path / "run.csv"), "--cell", str(cell), "-o", str(tmp_path / "out"))
    assert "does not exist" not in done.screen
    assert done.returncode in (0, 3), done.stderr
