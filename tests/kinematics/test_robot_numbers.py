"""Numbers that no arm has are told when its file is read; those of every shipped arm are not."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.kinematics.robot_numbers import REACH_SHARE
from planner.kinematics.robot_reader import describe_robot, list_robots, load_robot


def changed(folder, name, old, new):
    text = load_robot(name).path.read_text()
    assert text.count(old) >= 1
    (folder / "robot.toml").write_text(text.replace(old, new, 1))
    return folder / "robot.toml"


@pytest.mark.parametrize(
    ("name", "old", "new", "told"),
    [
        ("panda", "reach_mm = 855", "reach_mm = 1e-300", "reach_mm"),
        ("panda", "reach_mm = 855", "reach_mm = 855000", "reach_mm"),
        ("panda", "reach_mm = 855", "reach_mm = 8550", "reach_mm = 8550 does not belong to these links.*1393 mm"),
        ("panda", "reach_mm = 855", "reach_mm = 85.5", "reach_mm = 85.5 does not belong to these links"),
        ("ur10", "payload_kg = 10", "payload_kg = 300000", "payload_kg"),
        ("ur10", "payload_kg = 10", "payload_kg = 0", "payload_kg"),
        ("ur10", "repeatability_mm = 0.1", "repeatability_mm = 0", "repeatability_mm"),
        ("ur10", "repeatability_mm = 0.1", "repeatability_mm = 1e-300", "repeatability_mm"),
        ("ur10", "repeatability_mm = 0.1", "repeatability_mm = 100", "repeatability_mm"),
        ("iiwa14", "limit_deg = [-170", "limit_deg = [-1200", "joint 1 has the limits -1200.* allowed are 400"),
    ],
)
def test_a_senseless_number_is_refused(tmp_path, name, old, new, told):
    with pytest.raises(InputError, match=told):
        load_robot(changed(tmp_path, name, old, new))


@pytest.mark.parametrize("joint", range(7))
def test_a_slip_in_the_limit_of_any_axis_is_told(tmp_path, joint):
    text = load_robot("iiwa14").path.read_text()
    parts = text.split("limit_deg = [-")
    assert len(parts) == 8
    before = "limit_deg = [-".join(parts[: joint + 1])
    after = "limit_deg = [-".join(parts[joint + 1 :])
    (tmp_path / "robot.toml").write_text(f"{before}limit_deg = [-1200, {after.partition(',')[2]}")
    with pytest.raises(InputError, match=f"joint {joint + 1} has the limits -1200"):
        load_robot(tmp_path / "robot.toml")


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_links_in_another_unit_are_told(tmp_path, factor):
    table = np.array([[0, 0, 0, 118], [90, 0, 180, 0], [0, 612.7, 0, 0], [0, 571.6, 0, 163.9], [-90, 0, 0, 115.7]])
    table[:, [1, 3]] *= factor
    header = "# convention: mdh\nalpha_deg,a_mm,theta_deg,d_mm"
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=header, comments="")
    with pytest.raises(InputError, match=r"add up to .* mm, arms have 50 to 20000 mm"):
        load_robot(tmp_path / "arm.csv")


def test_no_shipped_arm_is_near_a_bound():
    for name in list_robots():
        robot, stated = load_robot(name), describe_robot(load_robot(name).path).reach_mm
        length = 1e3 * sum(abs(t.nominal) for t in robot.transforms if t.kind == "translation")
        assert REACH_SHARE[0] * 1.5 < stated / length < REACH_SHARE[1] / 1.3, name


def test_a_wrist_may_turn_many_times(tmp_path):
    rows = ["0,0,0,118,-400,400", "90,0,180,0,-90,90", "0,612.7,0,0,-90,90", "0,571.6,0,163.9,-400,400"]
    rows += ["-90,0,0,115.7,-120,120", "90,0,180,92.2,-2700,2700"]
    header = "# convention: mdh\nalpha_deg,a_mm,theta_deg,d_mm,lower_deg,upper_deg\n"
    (tmp_path / "arm.csv").write_text(header + "\n".join(rows))
    assert np.rad2deg(load_robot(tmp_path / "arm.csv").q_upper[-1]) == pytest.approx(2700)
