"""An SRDF beside a URDF: its pairs are left out as it writes them, link by link, with the reason that it states."""

from dataclasses import replace
from pathlib import Path

import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.motion.collision.scene import build_scene
from planner.motion.collision.surroundings import unchecked_links_text

JOINT = (
    '<joint name="j{k}" type="{kind}"><parent link="l{p}"/><child link="l{k}"/><origin xyz="0 0 0.2"/>'
    '<axis xyz="0 {y} {z}"/><limit lower="-2" upper="2" velocity="1"/></joint>'
)
LINK = '<link name="l{k}"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'


def write_arm(folder: Path, allowed: list[tuple[str, str]]) -> Path:
    """Six joints, then a hand that is fixed to the last link."""
    links = "".join(LINK.format(k=k) for k in range(8))
    joints = "".join(
        JOINT.format(k=k, p=k - 1, kind="fixed" if k == 7 else "revolute", y=k % 2, z=1 - k % 2) for k in range(1, 8)
    )
    (folder / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    pairs = "".join(f'<disable_collisions link1="{a}" link2="{b}" reason="Default"/>' for a, b in allowed)
    (folder / "arm.srdf").write_text(f'<robot name="arm">{pairs}</robot>')
    return folder / "arm.urdf"


def checked(robot: Robot) -> set[tuple[str, str]]:
    """Links of the robot that are checked against each other."""
    scene = build_scene(replace(load_cell("ur10/edbb"), robot=robot))
    found = [(scene.pieces[a], scene.pieces[b]) for a, b in scene.pairs]
    pairs = [sorted((a.body.part, b.body.part)) for a, b in found if a.of_robot and b.of_robot]
    return {(a, b) for a, b in pairs}


def test_links_that_an_srdf_names_are_not_checked_however_far_apart(tmp_path: Path) -> None:
    every = checked(load_robot(write_arm(tmp_path, [])))
    assert {("l0", "l2"), ("l0", "l5"), ("l4", "l6"), ("l4", "l7")} <= every
    path = write_arm(tmp_path, [("l0", "l2"), ("l3", "l1"), ("l0", "l5"), ("l4", "l6"), ("l5", "l6")])
    robot = load_robot(path)
    assert every - checked(robot) == {("l0", "l2"), ("l1", "l3"), ("l0", "l5"), ("l4", "l6")}  # not the hand, l7
    (told,) = unchecked_links_text(replace(load_cell("ur10/edbb"), robot=robot))
    assert "l0 and l2, l0 and l5, l1 and l3, l4 and l6 (arm.srdf: Default)" in told


def test_bodies_of_robot_toml_are_left_out_where_all_links_that_they_stand_for_are(tmp_path: Path) -> None:
    text = 'schema = "edbb-robot/1"\nname = "arm"\nconvention = "urdf"\nurdf = "arm.urdf"\nsrdf = "arm.srdf"\n'
    text += '[[bodies]]\nlink = 0\nkind = "sphere"\nat_mm = [0, 0, 0]\nradius_mm = 30\n'
    for allowed, found in (([("l4", "l6")], set()), ([("l4", "l6"), ("l7", "l4"), ("l0", "l2")], {(4, 6), (0, 2)})):
        write_arm(tmp_path, allowed)
        (tmp_path / "robot.toml").write_text(text)
        assert load_robot(tmp_path / "robot.toml").never_meet == found  # a body of link 6 would be the hand's too


def test_an_srdf_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = write_arm(tmp_path, [])
    (tmp_path / "arm.srdf").write_text("<robot")
    with pytest.raises(InputError, match=r"arm\.srdf"):
        load_robot(path)
