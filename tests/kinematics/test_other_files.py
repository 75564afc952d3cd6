"""Robots in the files of other software: tables of DH rows, templates of URDFs."""

import re

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.session.movable_cell import cell_files

# modified DH of a UR10 as pybotics ships it: alpha, a, theta, d [rad, mm]
ROWS = np.array([
    [0, 0, 0, 118], [np.pi / 2, 0, np.pi, 0], [0, 612.7, 0, 0], [0, 571.6, 0, 163.9], [-np.pi / 2, 0, 0, 115.7],
    [np.pi / 2, 0, np.pi, 92.2],
])  # fmt: skip


def by_hand(rows, q):
    """Craig's modified DH, written out: the last frame, (4, 4) [mm]."""
    T = np.eye(4)
    for (alpha, a, theta, d), turn in zip(rows, q, strict=True):
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta + turn), np.sin(theta + turn)
        T = T @ [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]]
    return T


def save(path, header, rows, comments="# convention: mdh\n", delimiter=","):
    np.savetxt(path, rows, delimiter=delimiter, header=header, comments=comments)
    return path


def test_pybotics_and_robodk_write_the_same_robot(tmp_path):
    one = save(tmp_path / "pybotics.csv", "alpha_rad,a_mm,theta_rad,d_mm", ROWS)
    table = np.c_[np.rad2deg(ROWS[:, 0]), ROWS[:, 1] / 1e3, np.rad2deg(ROWS[:, 2]), ROWS[:, 3] / 1e3]
    two = save(tmp_path / "robodk.csv", "α (°);a [m];θ (°);d [m]", table, delimiter=";")
    q = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    for path in (one, two):
        robot = load_robot(path)
        x = robot.chain.carry(robot.theta(q), np.zeros(3))
        np.testing.assert_allclose(x * 1e3, [by_hand(ROWS, one_q)[:3, 3] for one_q in q], atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("# convention: mdh\n", "", "must say what the rows mean"),
        ("alpha_rad", "alpha", "'alpha' does not say its unit: alpha_deg or alpha_rad"),
        ("d_mm", "e_mm", "'e_mm' is no column of a DH table"),
        (",d_mm", "", "no column d; the columns are alpha, a, theta, d"),
        ("6.127", "x6.127", "line 5, column 'a': .* is no number"),
    ],
)
def test_what_is_wrong_with_a_table_is_told(tmp_path, old, new, told):
    path = save(tmp_path / "arm.csv", "alpha_rad,a_mm,theta_rad,d_mm", ROWS)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=told):
        load_robot(path)


XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="reach" value="0.3"/>
<link name="l0"/>
<xacro:macro name="part" params="k axis"><link name="l${k}"/><joint name="j${k}" type="revolute">
<parent link="l${k - 1}"/><child link="l${k}"/><origin xyz="0 0 ${reach / 2}"/><axis xyz="${axis}"/>
<limit lower="-2" upper="2" velocity="2" effort="1"/></joint></xacro:macro>
<xacro:part k="1" axis="0 0 1"/><xacro:part k="2" axis="0 1 0"/><xacro:part k="3" axis="0 1 0"/>
<xacro:part k="4" axis="1 0 0"/><xacro:part k="5" axis="0 1 0"/><xacro:part k="6" axis="1 0 0"/></robot>"""
CELL = """schema = "edbb-cell/1"
robot = "arm.urdf.xacro"
tip = "l6"
home_deg = [0, 20, 20, 0, 20, 0]
[tool]
map_mm = [30, 0, 50]
[gauge]
kind = "draw-wire"
length_mm = [100, 400]
[[fixtures]]
position_mm = [400, 100, 200]
"""


def test_a_template_is_expanded_and_kept_as_a_urdf(tmp_path):
    (tmp_path / "arm.urdf.xacro").write_text(XACRO)
    (tmp_path / "cell.toml").write_text(CELL)
    cell = load_cell(tmp_path / "cell.toml")
    assert cell.robot.name == "arm"
    np.testing.assert_allclose(cell.map_position(np.zeros((1, 6))), [[0.03, 0, 0.95]], atol=1e-12)
    files = cell_files(cell)
    assert set(files) == {"cell.toml", "arm.urdf"}
    assert b"xacro:" not in files["arm.urdf"]
    (tmp_path / "kept").mkdir()
    for name, content in files.items():
        (tmp_path / "kept" / name).write_bytes(content)
    again = load_cell(tmp_path / "kept" / "cell.toml")
    q = np.random.default_rng(1).uniform(-1, 1, (4, 6))
    np.testing.assert_allclose(again.map_position(q), cell.map_position(q), atol=1e-12)


def test_a_template_that_cannot_be_expanded_says_what_and_where(tmp_path):
    (tmp_path / "arm.urdf.xacro").write_text(XACRO.replace("${reach / 2}", "${rich / 2}"))
    told = re.escape("name 'rich' is not defined when evaluating expression 'rich / 2' (at arm.urdf.xacro, macro part)")
    with pytest.raises(InputError, match=told):
        load_robot(tmp_path / "arm.urdf.xacro", tip="l6")
