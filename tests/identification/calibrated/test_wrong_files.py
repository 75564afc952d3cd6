"""Wrong ``[[effects]]``, ``[loads]`` and ``[nominal]`` tables: one clear sentence with the file and the key."""

import pytest

from planner.common.errors import InputError
from planner.documents.calibrated_robot import CalibratedRobot
from planner.kinematics.robot_reader import load_robot

EFFECT = """
[[effects]]
name = "compliance2"
on = "theta2"
phi = "torque:2"
value = 1.5
unit = "urad/Nm"
"""
LOADS = "[loads]\npayload_kg = 3\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("theta2", "thetta2", 'effect 1 .* did you mean "theta2"'),
        ("torque:2", "torqe:2", "compliance2.*did you mean"),
        ("torque:2", "torque:9", "compliance2.*from 1 to 6"),
        ("urad/Nm", "urad/Ncm", "'Ncm' is no unit"),
        ("urad/Nm", "murad", "'murad' is no unit"),
        ("torque:2", "place:0", "static = false"),
        ("1.5", "nan", "finite"),
        ("payload_kg = 3", "payload_kg = -3", "payload_kg"),
        ("payload_kg", "payload_lb", "unknown key"),
        (LOADS, "", r"no \[loads\]"),
        (LOADS, LOADS + "[nominal]\nalpha2 = 3\n", 'did you mean "alpha2_deg"'),
        (LOADS, LOADS + "[nominal]\na9_mm = 3\n", "names no transform"),
        ("value = 1.5", "valu = 1.5", 'did you mean "value"'),
    ],
)
def test_a_wrong_file_is_named_with_its_key(old, new, words, tmp_path):
    text = load_robot("ur10").path.read_text() + EFFECT + LOADS
    assert text.count(old) >= 1
    at = text.rindex(old)
    (tmp_path / "robot.toml").write_text(text[:at] + new + text[at + len(old) :])
    with pytest.raises(InputError, match=words) as caught:
        CalibratedRobot(load_robot("robot.toml", tmp_path))
    assert "robot.toml" in str(caught.value)


def test_the_value_is_read_in_its_unit(tmp_path):
    text = load_robot("ur10").path.read_text() + EFFECT + LOADS
    (tmp_path / "robot.toml").write_text(text)
    effect = load_robot("robot.toml", tmp_path).effects[0]
    assert (effect.value, effect.unit) == (pytest.approx(1.5e-6), "rad/Nm")
