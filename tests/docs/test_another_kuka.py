"""The table of the KUKA tutorial, followed to the letter, makes other KUKAs: held against a chain of their own."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.kinematics.robot_reader import load_robot
from planner.motion.collision.body_gaps import find_body_gaps
from tests.docs.test_pages import PAGES, ROOT

TABLE = r"^\| what \| where \| KR 6 R700 sixx \|.*?(?=^$)"
# Origins of the joints of ROS-Industrial's kuka_kr10_support [m], and their axes: all frames parallel at A = 0.
AXES = [(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)]
ORIGINS = {
    "KR 10 R1100 sixx": [(0, 0, 0.4), (0.025, 0, 0), (0.56, 0, 0), (0, 0, 0.035), (0.515, 0, 0), (0.08, 0, 0)],
    "KR 10 R900-2": [(0, 0, 0.4), (0.025, 0, 0), (0.455, 0, 0), (0, 0, 0.025), (0.42, 0, 0), (0.09, 0, 0)],
}
SPEEDS = {"KR 10 R1100 sixx": [360, 300, 360, 381, 388, 615], "KR 10 R900-2": [300, 225, 330, 360, 360, 433]}


def rows_for(robot):
    """What the table says of a robot: (what, where, value)."""
    (table,) = re.findall(TABLE, PAGES["docs/tutorials/kuka-bar.md"], re.MULTILINE | re.DOTALL)
    head, _, *lines = ([c.strip() for c in line.strip("|").split("|")] for line in table.splitlines())
    return [(cells[0], cells[1], cells[head.index(robot)]) for cells in lines]


def set_key(text, span, key, value, place=None):
    """Set a key of the part of the file between two places, or one number of its list."""
    begin, end = span
    part = text[begin:end]
    (old,) = re.findall(rf"^{key} = (.*?)(?: *#.*)?$", part, re.MULTILINE)
    if place is not None:
        numbers = old.strip("[]").split(",")
        numbers[place] = value
        value = f"[{', '.join(n.strip() for n in numbers)}]"
    return text[:begin] + part.replace(f"{key} = {old}", f"{key} = {value}", 1) + text[end:]


def part_of(text, mark, number=0):
    """Where a table of the file begins and ends."""
    begins = [m.start() for m in re.finditer(mark, text, re.MULTILINE)]
    begin = begins[number]
    return begin, text.find("\n[[", begin + 2)


def follow(text, robot):
    """Change a robot's file as each row of the table says."""
    for what, where, value in rows_for(robot):
        keys = re.findall(r"`(\w+)`", where)
        if body := re.search(r"\*(.+)\*", what):
            place = {"first": 0, "third": 2}[re.match(r"\w+", where)[0]]
            for key in keys:
                text = set_key(text, part_of(text, rf"^\[\[bodies\]\]  # {body[1]}$"), key, value, place)
        elif "A1 to A6" in where:
            for k, speed in enumerate(value.split(", ")):
                text = set_key(text, part_of(text, r"^\[\[joints\]\]", k), keys[0], speed)
        elif axis := re.search(r"of A(\d)", where):
            text = set_key(text, part_of(text, r"^\[\[joints\]\]", int(axis[1]) - 1), keys[0], value)
        else:
            text = set_key(text, (0, len(text)), keys[0], value)
    return text


def flange_of(robot, a):
    """Place and rotation of the flange by the chain of origins and axes, at angles a (6,) [rad]."""
    p, R = np.zeros(3), Rotation.identity()
    for origin, axis, angle in zip(ORIGINS[robot], AXES, a, strict=True):
        p = p + R.apply(origin)
        R = R * Rotation.from_rotvec(np.array(axis) * angle)
    return p, (R * Rotation.from_euler("y", 90, degrees=True)).as_matrix()


@pytest.mark.parametrize("name", sorted(ORIGINS))
def test_the_table_makes_another_kuka(name, tmp_path):
    shipped = (ROOT / "robots" / "kuka-kr6-r700" / "robot.toml").read_text()
    file = tmp_path / "robot.toml"
    file.write_text(follow(shipped, name))
    robot = load_robot(str(file), tmp_path)
    rng = np.random.default_rng(7)
    q = rng.uniform(robot.q_lower, robot.q_upper, (200, 6))
    motion = robot.chain.forward(robot.theta(q))
    for k, angles in enumerate(q):
        p, R = flange_of(name, angles)
        np.testing.assert_allclose(motion.x[:, k], p, atol=1e-12)
        np.testing.assert_allclose(motion.R[:, :, k], R, atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(robot.speed), SPEEDS[name])
    assert find_body_gaps(robot) == ()
    (reach,) = (float(v) for what, _, v in rows_for(name) if what.startswith("reach"))
    wrist = 25 + 1e3 * ORIGINS[name][2][0] + np.hypot(1e3 * ORIGINS[name][3][2], 1e3 * ORIGINS[name][4][0])
    assert reach == pytest.approx(wrist, abs=1.0)


def test_the_first_column_is_the_robot_that_is_shipped():
    shipped = (ROOT / "robots" / "kuka-kr6-r700" / "robot.toml").read_text()
    changed = follow(shipped, "KR 6 R700 sixx")
    number = re.compile(r"-?\d+(?:\.\d+)?")
    assert [float(n) for n in number.findall(changed)] == [float(n) for n in number.findall(shipped)]
