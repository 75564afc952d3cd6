"""Packages of ROS are named by the user: in the cell, in robot.toml or on the command line, and nowhere else."""

import shutil

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import INPUTS
from planner.kinematics.packages import COMMAND_PACKAGES
from planner.kinematics.robot_reader import load_robot
from planner.session.movable_cell import cell_files
from tests.command import edbb
from tests.motion.test_far_meshes import CORNERS, binary_stl

TEMPLATE = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:include filename="$(find arm_description)/urdf/link.xacro"/><link name="l0"/>{}</robot>"""
LINK = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="part" params="k axis">
<link name="l${k}"><collision><geometry>
<mesh filename="package://arm_description/meshes/link.stl" scale="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="j${k}" type="revolute"><parent link="l${k - 1}"/><child link="l${k}"/>
<origin xyz="0 0 0.2"/><axis xyz="${axis}"/><limit lower="-2" upper="2" velocity="2"/></joint></xacro:macro></robot>"""
CELL = """schema = "edbb-cell/1"
robot = "arm.urdf.xacro"
tip = "l6"
home_deg = [0, 20, 20, 0, 20, 0]
{}
[tool]
map_mm = [30, 0, 50]
[gauge]
kind = "draw-wire"
length_mm = [100, 400]
[[fixtures]]
position_mm = [400, 100, 200]
"""
NAMED = '[packages]\narm_description = "../checkout"\n'


@pytest.fixture
def folder(tmp_path):
    """A cell with a template beside it, and the package elsewhere, in a folder of another name."""
    for name in ("urdf", "meshes"):
        (tmp_path / "checkout" / name).mkdir(parents=True)
    (tmp_path / "checkout" / "urdf" / "link.xacro").write_text(LINK)
    (tmp_path / "checkout" / "meshes" / "link.stl").write_bytes(binary_stl(CORNERS))
    (tmp_path / "cell").mkdir()
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    parts = "".join(f'<xacro:part k="{k}" axis="{axis}"/>' for k, axis in enumerate(axes, 1))
    (tmp_path / "cell" / "arm.urdf.xacro").write_text(TEMPLATE.format(parts))
    return tmp_path / "cell"


def test_the_cell_names_them_and_what_is_kept_needs_none(folder, tmp_path):
    (folder / "cell.toml").write_text(CELL.format(NAMED))
    cell = load_cell(folder / "cell.toml")
    assert {b.mesh for _, b in cell.robot.bodies} == {(tmp_path / "checkout" / "meshes" / "link.stl").resolve()}
    files = cell_files(cell)
    shutil.rmtree(tmp_path / "checkout")
    kept = tmp_path / "kept"
    for name, content in files.items():
        (kept / name).parent.mkdir(parents=True, exist_ok=True)
        (kept / name).write_bytes(content)
    assert b"packages" not in (kept / "cell.toml").read_bytes()
    q = np.random.default_rng(0).uniform(-1, 1, (5, 6))
    np.testing.assert_allclose(load_cell(kept / "cell.toml").map_position(q), cell.map_position(q), atol=1e-12)


@pytest.mark.slow
def test_robot_toml_names_them(folder):
    text = 'schema = "edbb-robot/1"\nname = "arm"\nconvention = "urdf"\nurdf = "arm.urdf.xacro"\ntip = "l6"\n'
    (folder / "robot.toml").write_text(text + NAMED)
    (folder / "cell.toml").write_text(
        CELL.format("").replace("arm.urdf.xacro", "robot.toml").replace('tip = "l6"\n', "")
    )
    cell = load_cell(folder / "cell.toml")
    assert len(cell.robot.bodies) == 6
    written = cell_files(cell)["robot.toml"].decode()
    assert "packages" not in written
    (folder / "robot.toml").write_text(text)
    with pytest.raises(InputError, match="add --package arm_description=DIR"):
        load_robot(folder / "robot.toml")


@pytest.mark.slow
def test_the_command_line_names_them_for_one_command(folder):
    path = folder / "cell.toml"
    path.write_text(CELL.format(""))
    words = ("plan", path, "-o", folder / "out", "--poses", 2)
    unnamed = edbb(*words)
    assert unnamed.returncode == 2
    assert "add --package arm_description=DIR" in unnamed.screen
    named = edbb(*words, "--package", f"arm_description={folder.parent / 'checkout'}")
    assert "arm_description" not in named.screen  # the robot was read; two poses are too few
    assert named.returncode in (2, 3)
    assert "add --package arm_description=DIR" in edbb(*words).screen  # the next command knows nothing of it
    COMMAND_PACKAGES.set(())


@pytest.mark.parametrize("word", ["arm_description", "arm_description=", "=x", "arm_description=gone", "a/b=."])
def test_a_word_that_names_no_folder_is_told(folder, word):
    (folder / "cell.toml").write_text(CELL.format(""))
    done = edbb("plan", folder / "cell.toml", "-o", folder / "out", "--package", word)
    assert done.returncode == 2
    assert "--package" in done.screen


def test_a_job_of_strangers_names_no_folder_of_others(folder, monkeypatch):
    (folder / "cell.toml").write_text(CELL.format(NAMED))
    monkeypatch.setattr(INPUTS, "_within", (folder.resolve(),))
    with pytest.raises(InputError, match=r"packages: arm_description = .* lies outside the folder of this job"):
        load_cell(folder / "cell.toml")
    (folder / "cell.toml").write_text(CELL.format(""))
    (folder / "arm.urdf.xacro").write_text(
        TEMPLATE.format("").replace("$(find arm_description)/urdf/link.xacro", "../checkout/urdf/link.xacro")
    )
    with pytest.raises(InputError, match="outside the folders that this template may read"):
        load_cell(folder / "cell.toml")
