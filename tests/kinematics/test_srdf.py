"""An SRDF beside a URDF: of its pairs those next but one are left out, and only where all their bodies are named."""

from pathlib import Path

import pytest

from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot

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


def test_links_next_but_one_that_an_srdf_names_are_not_checked(tmp_path: Path) -> None:
    path = write_arm(tmp_path, [("l0", "l2"), ("l3", "l1"), ("l0", "l5"), ("l4", "l6"), ("l5", "l6")])
    robot = load_robot(path)
    assert robot.never_meet == {(0, 2), (1, 3)}  # l4 may meet the hand, which is one with l6
    assert "arm.srdf" in robot.never_meet_reason
    write_arm(tmp_path, [("l4", "l6"), ("l4", "l7")])
    assert load_robot(path).never_meet == {(4, 6)}


def test_an_srdf_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = write_arm(tmp_path, [])
    (tmp_path / "arm.srdf").write_text("<robot")
    with pytest.raises(InputError, match=r"arm\.srdf"):
        load_robot(path)
