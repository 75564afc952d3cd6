"""Cells and robots as the how-to pages show them are read as they stand there."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.kinematics.robot_reader import load_robot

PAGES = Path(__file__).resolve().parents[2] / "docs" / "how-to"
BLOCK = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
BLOCKS = BLOCK.findall((PAGES / "cell.md").read_text())
HEAD = BLOCKS[0].partition("[tool]")[0]
KINDS = {m[1]: b for b in BLOCKS if (m := re.search(r'kind = "([a-z-]+)"', b))}
URDF = """<robot name="my_arm"><link name="base"/>{links}</robot>"""
LINK = """<joint name="j{k}" type="revolute"><parent link="{before}"/><child link="{link}"/><origin xyz="0 0 0.2"/>
<axis xyz="0 {y} {z}"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint><link name="{link}"/>"""


def test_every_gauge_without_a_page_of_its_own_is_shown() -> None:
    assert set(KINDS) == {"edbb", "draw-wire", "tracker", "ball-socket"}


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_the_shortest_cell_of_a_gauge_is_whole(kind: str, tmp_path: Path) -> None:
    own = KINDS[kind]
    file = tmp_path / "cell.toml"
    file.write_text(own if own.startswith("schema") else HEAD + own)
    cell = load_cell(file)
    assert cell.gauge.kind == kind
    assert cell.motion.measure == "static"


def test_a_robot_file_of_rows_is_enough_to_plan(tmp_path: Path) -> None:
    (block,) = re.findall(r"^```text\n(schema.*?)^```", (PAGES / "robot.md").read_text(), re.MULTILINE | re.DOTALL)
    head, row = block.split("[[joints]]")
    row, sources = row.split("[sources]")
    folder = tmp_path / "robots" / "my-arm"
    folder.mkdir(parents=True)
    path = folder / "robot.toml"
    path.write_text(f"{head}[sources]{sources}" + 6 * f"[[joints]]{row}")
    robot = load_robot(str(path))
    assert dict(robot.sources)["jerks"].startswith("estimated: ")
    for limit in (robot.q_upper, robot.speed, robot.acceleration, robot.jerk):
        assert np.isfinite(limit).all()


def test_a_robot_file_that_names_a_urdf_is_read(tmp_path: Path) -> None:
    (block,) = BLOCK.findall((PAGES / "robot.md").read_text())
    (tmp_path / "robot.toml").write_text(block)
    names = ["base", *(f"l{k}" for k in range(1, 6)), "tool0"]
    links = [LINK.format(k=k, before=names[k], link=names[k + 1], y=k % 2, z=1 - k % 2) for k in range(6)]
    (tmp_path / "my_arm.urdf").write_text(URDF.format(links="".join(links)))
    (tmp_path / "my_arm.srdf").write_text(
        '<robot name="my_arm"><disable_collisions link1="l1" link2="l3" reason="Never"/></robot>'
    )
    robot = load_robot(str(tmp_path / "robot.toml"), tmp_path)
    assert robot.n_joints == 6
    assert robot.srdf == tmp_path / "my_arm.srdf"
