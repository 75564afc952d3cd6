"""Links of a URDF that no collision check knows are named wherever somebody looks before the robot moves."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.reading import load_cell
from planner.common.files import data_folder
from planner.kinematics.robot_reader import load_robot
from planner.programs.instructions import JointMove
from planner.programs.verification import write_program
from planner.session.neutral_program import build_program
from tests.command import edbb
from tests.kinematics.test_urdf_frames import UR10, urdf
from tests.programs.sessions import PULSES
from tests.workflow.conftest import small_cell

ENOUGH = ("candidates = 3000", "candidates = 900")
RADIUS = 0.02  # [m] thin, so that the wrist does not touch itself
SHAPE = "<geometry><cylinder radius='0.05' length='0.3'/></geometry>"


def collision(a, d):
    """A cylinder from the joint to the next one, whose origin is (a, 0, d)."""
    length, pitch = np.hypot(a, d), np.arctan2(a, d)
    return (
        f'<collision><origin xyz="{a / 2} 0 {d / 2}" rpy="0 {pitch} 0"/><geometry><cylinder radius="{RADIUS}" '
        f'length="{length}"/></geometry></collision>'
    )


def whole_arm():
    """A UR10 with a body for every link that moves; its tip is the name of a frame."""
    text = urdf([Rotation.identity()] * 6)
    for i, (_, a, d) in enumerate(UR10, 1):
        text = text.replace(f'<link name="l{i}"/>', f'<link name="l{i}">{collision(a, d)}</link>')
    return text


def fixed(name, parent, child):
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


EXTRA = (
    f'<link name="head"><visual>{SHAPE}</visual></link>{fixed("neck", "l0", "head")}'
    f'<link name="camera_frame"/>{fixed("look", "head", "camera_frame")}'
    f'<link name="arm2_upper"><collision>{SHAPE}</collision></link>'
    '<joint name="arm2_a" type="revolute"><parent link="l0"/><child link="arm2_upper"/>'
    '<origin xyz="-0.6 -0.6 0.1"/><limit lower="-1" upper="1"/></joint>'
    '<link name="arm2_lower"/>'
    '<joint name="arm2_b" type="prismatic"><parent link="arm2_upper"/><child link="arm2_lower"/></joint>'
    '<link name="finger_{l}"><inertial><mass value="0.1"/></inertial></link>'
    f'{fixed("grip", "tip", "finger_{l}")}</robot>'
)  # fmt: skip
BARE = ("l4", "head", "arm2_lower", "finger_{l}")


@pytest.fixture
def crowded(tmp_path):
    """An arm with a head, a second arm and a finger, whose fourth link has a mesh to look at and none to touch."""
    text = whole_arm().replace("</robot>", EXTRA)
    bare = re.sub(r'(<link name="l4">)<collision>.*?</collision>', rf"\1<visual>{SHAPE}</visual>", text)
    assert bare != text
    return cell_of(tmp_path, bare)


def cell_of(folder, text):
    (folder / "six.urdf").write_text(text)
    floor = ("[motion]", "[base]\nfloor_mm = -100\n\n[motion]")  # the first link begins in the base's plane
    return small_cell("ur10/edbb", folder, ENOUGH, floor, ('robot = "ur10"', 'robot = "six.urdf"\ntip = "tip"'))


def test_every_link_that_is_not_in_the_proof_is_known(crowded):
    found = dict(load_cell(crowded).robot.unchecked_links)
    assert set(found) == set(BARE)  # neither the camera's frame nor the tip's is a body, and arm2_upper is checked
    assert set(found.values()) == {"no collision shape"}


def test_bodies_in_robot_toml_stand_for_those_of_the_urdf(tmp_path):
    (tmp_path / "six.urdf").write_text(urdf([Rotation.identity()] * 6))
    text = 'schema = "edbb-robot/1"\nname = "six"\nconvention = "urdf"\nurdf = "six.urdf"\ntip = "tip"\n'
    body = '[[bodies]]\nlink = {}\nkind = "sphere"\nat_mm = [0, 0, 0]\nradius_mm = 30\n'
    (tmp_path / "robot.toml").write_text(text + "".join(body.format(k) for k in (1, 2, 3, 5, 6)))
    assert load_robot(tmp_path / "robot.toml").unchecked_links == (("l4", "no collision shape"),)


@pytest.mark.parametrize("dialect", sorted(p.name for p in data_folder("g-code").iterdir() if p.is_dir()))
def test_the_head_of_every_program_lists_them(crowded, dialect):
    cell = load_cell(crowded)
    home = JointMove(tuple(np.rad2deg(cell.home)), 10.0, 50.0, 5.0)
    program = replace(build_program(cell, "0" * 12, [home]), pulses_per_deg=PULSES[:6])
    files = write_program(program, dialect, "six")
    lines = files[0].text.splitlines()
    first = next((k for k, line in enumerate(lines) if "not checked for collisions" in line.lower()), None)
    assert first is not None, files[0].text
    head = re.sub(r"[^a-z0-9]+", " ", " ".join(lines[first : first + 12]).lower())
    for name in ("l4", "head", "arm2 lower", "finger l"):
        assert name in head
    told = re.sub(r"[^a-z0-9]+", " ", file_head(lines).lower())
    assert "these joints stand still" in told
    assert "arm2 a at 0 deg arm2 b at 0 mm" in told


def file_head(lines):
    return " ".join(re.sub(r"^\s*\d+:", "", line).strip(" ;/#-'(){}\"!%") for line in lines[:80])


@pytest.mark.long
def test_screen_plan_report_and_program_name_them(crowded):
    out = crowded.parent / "out"
    done = edbb("plan", crowded, "-o", out, "--poses", 25, "--dialect", "poses-csv")
    assert done.returncode == 0, done.stderr
    notes = json.loads((out / "plan.json").read_text())["notes"]
    report = re.sub(r"\s+", " ", (out / "report.html").read_text())
    program = out / "six_edbb.csv"
    for name in ("l4", "head", "arm2_lower"):
        assert sum(name in note and "not checked for collisions" in note for note in notes) == 1
        assert name in done.screen
        assert name in report
        assert name in program.read_text()[:4000]
    exported = edbb("export", out / "plan.json", "--dialect", "poses-json", "-o", crowded.parent / "six.json")
    assert exported.returncode == 0, exported.stderr
    assert "arm2_lower" in (crowded.parent / "six.json").read_text()[:4000]


@pytest.mark.slow
def test_of_a_robot_that_is_checked_whole_nothing_is_said(tmp_path):
    cell = load_cell(cell_of(tmp_path, whole_arm()))
    assert cell.robot.unchecked_links == ()
    home = JointMove(tuple(np.rad2deg(cell.home)), 10.0, 50.0, 5.0)
    (file,) = write_program(build_program(cell, "0" * 12, [home]), "poses-csv", "six")
    assert "not checked" not in file.text
    assert load_cell("ur10/edbb").robot.unchecked_links == ()
