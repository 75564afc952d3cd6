"""Files that others load: foreign tags, drives that are not stated, meshes to look at, ten joints."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.packages import Packages
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import RobotCorrections, mesh_files, write_robot
from tests.kinematics.test_parked_joints import tree
from tests.kinematics.test_parked_joints import write_robot as write_tree
from tests.motion.collision.test_meshes import stl
from tests.not_everywhere import pin
from tests.workflow.conftest import small_cell

DRAKE = '<drake:proximity_properties><drake:mesh_resolution_hint value="1.5"/></drake:proximity_properties>'
FOUND = RobotCorrections((), (), None, "by hand")


def test_foreign_tags_whose_prefix_nobody_declares_are_read_and_written(tmp_path: Path) -> None:
    """Drake's tags stand so in files that it, pinocchio and ROS load; the written file declares the prefix."""
    text = tree().replace("</collision>", f"{DRAKE}</collision>", 3)
    (tmp_path / "tree.urdf").write_text(text)
    robot = load_robot(tmp_path / "tree.urdf", tip="l6")
    assert [b.name for _, b in robot.bodies] == [b.name for _, b in load_robot_plain(tmp_path, "l6").bodies]
    written = dict(write_robot(robot, FOUND))["robot.urdf"]
    assert "drake:mesh_resolution_hint" in written
    (tmp_path / "again.urdf").write_text(written)
    assert pin.buildModelFromUrdf(str(tmp_path / "again.urdf")).nq > 0
    ET.fromstring(written)  # which refuses a prefix that nobody declares, as lxml does
    assert ET.tostring(ET.fromstring(written)).count(b"mesh_resolution_hint") == 3


def load_robot_plain(folder: Path, tip: str):
    (folder / "plain.urdf").write_text(tree())
    return load_robot(folder / "plain.urdf", tip=tip)


def test_a_comma_between_numbers_is_named_with_what_stands_there_instead(tmp_path: Path) -> None:
    """pinocchio takes such a file for no model at all."""
    (tmp_path / "tree.urdf").write_text(re.sub(r'xyz="([-\d.]+) ', r'xyz="\1, ', tree(), count=1))
    with pytest.raises(InputError, match=r"<origin>: xyz = '[-\d.]+,' is no number up to .*: blanks part numbers"):
        load_robot(tmp_path / "tree.urdf", tip="l6")


LIMIT = '<limit lower="-2" upper="2" velocity="1" effort="1"/>'
UNSAID = {
    "velocity 0": (LIMIT.replace('velocity="1"', 'velocity="0"'), "speed_deg_s", "speed_deg_s = 90"),
    "no velocity": (LIMIT.replace('velocity="1" ', ""), "speed_deg_s", "speed_deg_s = 90"),
    "no stroke": ('<limit velocity="1" effort="1"/>', "limit_deg", "limit_deg = [-170, 170]"),
}


@pytest.mark.parametrize("case", UNSAID)
def test_what_a_joint_does_not_say_is_asked_for_and_taken_from_robot_toml(tmp_path: Path, case: str) -> None:
    limit, missing, line = UNSAID[case]
    text = re.sub(r'(<joint name="j2".*?)' + re.escape(LIMIT), rf"\1{limit}", tree(), count=1)
    assert text != tree()
    cell = small_cell("ur10/edbb", tmp_path, ('robot = "ur10"', 'robot = "tree.urdf"\ntip = "l6"'))
    (tmp_path / "tree.urdf").write_text(text)
    load_cell(cell, planning=False)  # a run can be identified without
    with pytest.raises(InputError, match=rf"joint 3 has no {missing}.*robot\.toml.*(?s:.*)name = \"j2\"\n") as told:
        load_cell(cell)
    assert line in str(told.value)
    lines = str(told.value).split('tree.urdf", tip = "l6"):\n')[1]
    write_tree(tmp_path, lines)
    (tmp_path / "tree.urdf").write_text(text)
    cell.write_text(cell.read_text().replace('robot = "tree.urdf"\ntip = "l6"', 'robot = "robot.toml"'))
    robot = load_cell(cell).robot
    whole = load_robot_plain(tmp_path, "l6")
    expected = {
        "speed_deg_s": (robot.speed, np.pi / 2, whole.speed),
        "limit_deg": (robot.q_upper, np.deg2rad(170), whole.q_upper),
    }
    found, said, others = expected[missing]
    assert found[2] == pytest.approx(said)
    assert np.delete(found, 2) == pytest.approx(np.delete(others, 2))
    assert (robot.coupling_matrix == whole.coupling_matrix).all()


def test_a_table_of_a_joint_that_is_not_there_is_refused(tmp_path: Path) -> None:
    write_tree(tmp_path, '[[joints]]\nname = "elbow"\nspeed_deg_s = 90')
    with pytest.raises(InputError, match=r"1 \[\[joints\]\] tables, but the chain of the URDF has 6 joints.*j0, j1"):
        load_robot(tmp_path / "robot.toml")


def test_meshes_to_look_at_are_written_beside_the_corrected_urdf(tmp_path: Path) -> None:
    """As those to touch are: the folder shows the same arm wherever it is carried, also without the package."""
    package = tmp_path / "arm_description"
    for name in ("look/link.stl", "touch/link.stl"):
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        stl(package / name, 0.1 if name.startswith("look") else 0.2)
    mesh = '<{0}><geometry><mesh filename="package://arm_description/{1}/link.stl"/></geometry></{0}>'
    shapes = mesh.format("visual", "look") + mesh.format("collision", "touch")
    text = re.sub(r'(<link name="l3">).*?</link>', rf"\1{shapes}</link>", tree())
    (tmp_path / "tree.urdf").write_text(text)
    robot = load_robot(tmp_path / "tree.urdf", tip="l6", packages=Packages({"arm_description": package.resolve()}))
    out = tmp_path / "calibrated"
    for name, content in (*((n, t.encode()) for n, t in write_robot(robot, FOUND)), *mesh_files(robot)):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(content)
    written = (out / "robot.urdf").read_text()
    assert "package://" not in written
    sizes = {}
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        model = pin.buildModelFromUrdf(str(out / "robot.urdf"))
        geometry = pin.buildGeomFromUrdf(model, str(out / "robot.urdf"), kind, package_dirs=[str(out)])
        (found,) = [g for g in geometry.geometryObjects if g.name.startswith("l3_")]
        vertices = found.geometry.vertices()
        sizes[kind] = np.ptp(vertices, axis=0).max()
    assert sizes[pin.GeometryType.COLLISION] == pytest.approx(2 * sizes[pin.GeometryType.VISUAL])
    files = {m.get("filename") for m in ET.fromstring(written).iter("mesh")}
    assert len(files) == 2
    assert all((out / name).is_file() for name in files)
    again = load_robot(out / "robot.toml")
    assert len(again.bodies) == len(robot.bodies)


def test_meshes_lie_where_a_file_made_for_mujoco_says(tmp_path: Path) -> None:
    """By their names alone, below ``meshdir``; MuJoCo and whoever reads the folder find those of the written file."""
    (tmp_path / "meshes" / "arm").mkdir(parents=True)
    (tmp_path / "urdf").mkdir()
    stl(tmp_path / "meshes" / "arm" / "link.STL", 0.2)
    shape = '<collision><geometry><mesh filename="old/link.STL"/></geometry></collision>'
    text = re.sub(r'(<link name="l3">).*?</link>', rf"\1{shape}</link>", tree())
    (tmp_path / "urdf" / "tree.urdf").write_text(text)
    with pytest.raises(
        InputError, match=r"'old/link.STL' of link 'l3' does not exist in any folder above the file; lay"
    ):
        load_robot(tmp_path / "urdf" / "tree.urdf", tip="l6").check_meshes()
    where = '<mujoco><compiler meshdir="../meshes/arm" discardvisual="false"/></mujoco><link name="l3">'
    (tmp_path / "urdf" / "tree.urdf").write_text(text.replace('<link name="l3">', where))
    robot = load_robot(tmp_path / "urdf" / "tree.urdf", tip="l6")
    assert [b.kind for _, b in robot.bodies].count("mesh") == 1
    out = tmp_path / "calibrated"
    for name, content in (*((n, t.encode()) for n, t in write_robot(robot, FOUND)), *mesh_files(robot)):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(content)
    written = ET.parse(out / "robot.urdf").getroot()
    (mesh,), (compiler,) = written.iter("mesh"), written.iter("compiler")
    assert (out / mesh.get("filename", "")).is_file()
    assert (out / compiler.get("meshdir", "") / Path(mesh.get("filename", "")).name).is_file()
    assert len(load_robot(out / "robot.toml").bodies) == len(robot.bodies)


def test_a_chain_of_ten_joints_is_read(tmp_path: Path) -> None:
    """A torso of three and an arm of seven: forward kinematics by pinocchio from the same file."""
    links = "".join(f'<link name="l{k}"/>' for k in range(11))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0.02 0.01 0.15" '
        f'rpy="{0.1 * k} 0.2 0"/><axis xyz="{int(k % 3 == 1)} {int(k % 3 == 2)} {int(k % 3 == 0)}"/>{LIMIT}</joint>'
        for k in range(10)
    )
    (tmp_path / "ten.urdf").write_text(f'<robot name="ten">{links}{joints}</robot>')
    robot = load_robot(tmp_path / "ten.urdf")
    assert robot.n_joints == 10
    model = pin.buildModelFromUrdf(str(tmp_path / "ten.urdf"))
    data = model.createData()
    for q in np.random.default_rng(0).uniform(-2, 2, (5, 10)):
        pin.framesForwardKinematics(model, data, q)
        (frame,) = robot.chain.frames(robot.theta(q[None]), robot.link_end[-1:])
        np.testing.assert_allclose(frame[1][:, 0], data.oMf[model.getFrameId("l10")].translation, atol=1e-12)
    text = dict(write_robot(robot, RobotCorrections((("x10", 0.03),), (), None, "by hand")))["robot.urdf"]
    (tmp_path / "new.urdf").write_text(text)
    origin = re.search(r'name="j9".*?xyz="([^"]+)"', text)
    assert origin is not None
    assert float(origin[1].split()[0]) == pytest.approx(0.03)
