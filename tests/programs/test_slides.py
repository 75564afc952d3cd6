"""Programs of arms with a joint that slides: external axes in mm, metres in ROS, and what a language cannot say."""

import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.units import DEG
from planner.programs.controller_axes import _units_of
from planner.programs.dialect import load_dialect
from planner.programs.instructions import JointMove
from planner.programs.verification import import_map
from planner.session.neutral_program import build_program, write_session
from tests.kinematics.sliding_arms import lift_text
from tests.workflow.conftest import small_cell

ROBOT = """schema = "edbb-robot/1"
name = "lift"
convention = "urdf"
urdf = "lift.urdf"
tip = "l6"
[controllers.krl]
same = true
source = "jogged on 2026-03-02"
[controllers.rapid]
sense = [1, 1, -1, 1, 1, 1, -1]
zero_deg = [0, 0, -90, 0, 0, 0]
zero_mm = [1000]
source = "jogged on 2026-03-02"
"""
SAME = 'same = true\nsource = "jogged on 2026-03-02"\n'
PLACES = ((150.0, 10.0, -20.0, 30.0, -40.0, 50.0, -60.0), (250.5, 11.0, -20.0, 30.0, -40.0, 50.0, -60.0))


@pytest.fixture
def cell(tmp_path: Path):
    (tmp_path / "lift.urdf").write_text(lift_text())
    others = "".join(f"[controllers.{name}]\n{SAME}" for name in ("fanuc-tp", "pdl2", "bnr", "sinumerik"))
    (tmp_path / "robot.toml").write_text(ROBOT + others)
    return load_cell(small_cell("ur10/edbb", tmp_path, ('robot = "ur10"', 'robot = "robot.toml"\nhome_mm = [150]')))


def text_of(cell, dialect: str) -> str:
    """Write two moves; what is written has been read back by the language's own reader."""
    moves = [JointMove(place, 10.0, 50.0, 5.0) for place in (tuple(np.rad2deg(cell.home)), *PLACES)]
    return "".join(f.text for f in write_session(cell, build_program(cell, "0" * 12, moves), dialect, "lift"))


def test_krl_drives_the_lift_as_e1(cell) -> None:
    text = text_of(cell, "krl")
    assert "A1 10.0000,A2 -20.0000,A3 30.0000,A4 -40.0000,A5 50.0000,A6 -60.0000,E1 150.0000}" in text
    assert "E1 250.5000}" in text
    assert "E1 = q1" in text


def test_rapid_drives_the_lift_as_eax_a_by_its_own_zero_and_sense(cell) -> None:
    text = text_of(cell, "rapid")
    assert "[[10.0000,-20.0000,-120.0000,-40.0000,50.0000,-60.0000],[850.0000,9E9,9E9,9E9,9E9,9E9]]" in text
    assert "[749.5000,9E9" in text


def test_ros_drives_it_in_metres(cell) -> None:
    document = yaml.safe_load(text_of(cell, "ros2-trajectory"))
    assert document["joint_names"][0] == "lift"
    assert document["points"][-1]["positions"] == pytest.approx([0.2505, *np.multiply(PLACES[1][1:], DEG)], abs=1e-7)


def test_lists_of_poses_say_the_unit(cell) -> None:
    table = text_of(cell, "poses-csv")
    assert "kind,pose,q1_mm,q2_deg,q3_deg" in table
    assert "move,,250.5000,11.0000" in table
    listed = text_of(cell, "poses-json")
    assert '"joint_units": ["mm", "deg"' in listed
    assert '"q": [250.5000, 11.0000' in listed


@pytest.mark.parametrize("dialect", ["fanuc-tp", "pdl2", "bnr", "sinumerik"])
def test_a_language_without_external_axes_here_is_refused_with_those_that_have_them(cell, dialect: str) -> None:
    with pytest.raises(InputError, match=r"axis 7 of lift slides.*\[parked\].*krl.*rapid"):
        text_of(cell, dialect)


@pytest.mark.parametrize("dialect", ["krl", "rapid", "urscript"])
def test_an_arm_of_few_axes_is_not_sent_to_a_language_that_refuses_it_too(dialect: str) -> None:
    """External axes of both languages stand behind six that turn, and a short arm has four."""
    program = SimpleNamespace(joint_units=("mm", *4 * ("deg",)), robot="short")
    axes = SimpleNamespace(matrix=np.roll(np.eye(5), -1, axis=0))
    with pytest.raises(InputError, match="axis 5 of short slides") as told:
        _units_of(program, axes, load_dialect(dialect))
    others = str(told.value).rpartition("export to one of ")[2].split(", ")
    assert set(others) >= {"poses-csv", "ros2-trajectory"}
    assert not {"krl", "rapid", "urscript"} & set(others)


def test_the_log_of_an_external_axis_is_read_in_millimetres(cell, tmp_path: Path) -> None:
    pattern = tomllib.loads(import_map("krl", 7, 1))["pattern"]
    row = "LOG_0[1]={POSE 4,AX {A1 1.0,A2 2.0,A3 3.0,A4 4.0,A5 5.0,A6 6.0,E1 -250.5}}"
    found = re.search(pattern, row)
    assert found is not None
    assert found["q7_mm"] == "-250.5"
    assert found["q6_deg"] == "6.0"


WRONG = {
    "zero_mm = [1000]": ("zero_mm = [1000, 2]", "zero_mm has 2 values, the robot has 1 joints that slide"),
    "zero_deg = [0, 0, -90, 0, 0, 0]": ("zero_deg = [0, 0, -90, 0, 0, 0, 700]", "6 joints that turn"),
    "zero_mm = [1000]\n": ("coupling = [[7, 6, 1]]\n", "axes that slide count with no other"),
}


@pytest.mark.parametrize("old", WRONG)
def test_what_a_controllers_table_says_of_a_slide_is_checked(tmp_path: Path, old: str) -> None:
    new, said = WRONG[old]
    (tmp_path / "lift.urdf").write_text(lift_text())
    (tmp_path / "robot.toml").write_text(ROBOT.replace(old, new))
    with pytest.raises(InputError, match=re.escape(said)):
        load_cell(small_cell("ur10/edbb", tmp_path, ('robot = "ur10"', 'robot = "robot.toml"\nhome_mm = [150]')))
