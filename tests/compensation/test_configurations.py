"""Status, turn and confdata: kept as written where the corrected joints allow it, renewed where they do not."""

import re

import numpy as np
import pytest

from planner.compensation.compensated_file import compensate_file
from planner.kinematics.robot_reader import load_robot
from tests.compensation.robots import BentRobot, bent, exact, pin_flange
from tests.compensation.test_cartesian import abc_of, frame_text, kuka_status, rapid

NO_FRAMES = f"$TOOL={frame_text(np.zeros(6))}\n$BASE={frame_text(np.zeros(6))}\n"
HOMES = [
    [0, -90, 90, 0, 60, 0], [0, -90, 90, 0, -60, 0], [0, -90, 90, 180, 60, 0], [90, -80, 100, 0, 45, 0],
    [0, -70, 100, 0, 30, 0], [0, -60, 80, 0, 90, 0], [-90, -90, 90, 0, 50, 0], [0, -100, 110, 0, 70, 180],
    [0, -45, 60, 90, 40, -90], [0, -90, 120, -90, 30, 0],
]  # fmt: skip


def turned(robot, angles):
    """A robot whose joints stand further by ``angles`` [deg] than the controller believes."""
    by_joint = robot.sense_matrix @ np.radians(angles)
    delta = [0.0 if t.joint is None else by_joint[t.joint] for t in robot.transforms]
    return BentRobot(robot, np.array(delta))


def krl_home(robot, q_deg, turn=None):
    q = np.radians(q_deg)
    x = abc_of(pin_flange(exact(robot), q))
    turn = int((q < 0) @ (1 << np.arange(6))) if turn is None else turn
    numbers = ",".join(f"{k} {v:.3f}" for k, v in zip("XYZABC", x, strict=True))
    return f"DEF P ( )\n{NO_FRAMES}PTP {{{numbers},S {kuka_status(robot, q)},T {turn}}}\nEND\n"


def words(text):
    return tuple(int(v) for v in re.search(r"S (\d+),T (\d+)", text).groups())


@pytest.mark.parametrize("by", [0.08, -0.08, 0.9, -0.9])
@pytest.mark.parametrize("home", HOMES)
def test_turn_bits_say_the_corrected_joints_and_the_file_can_be_read_again(home, by, tmp_path):
    """A4 at 0 corrected to -0.08°: its bit is set, and no other."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "home.src"
    path.write_text(krl_home(robot, home))
    done = compensate_file(path, robot, turned(robot, [by, 0, 0, by, 0, by]))
    expected = np.array(home) - [by, 0, 0, by, 0, by]
    status, turn = words(done.text)
    assert turn == int((expected < 0) @ (1 << np.arange(6)))
    assert status == words(krl_home(robot, home))[0]
    path.write_text(done.text)
    again = compensate_file(path, robot, exact(robot))
    assert again.text == done.text


@pytest.mark.parametrize("home", HOMES)
def test_what_is_written_stays_where_the_joint_is_still_at_its_border(home, tmp_path):
    """At exactly 0° either bit names the joint: no correction, no change, whichever was taught."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "home.src"
    zero = int((np.array(home) == 0) @ (1 << np.arange(6)))
    signs = int((np.array(home) < 0) @ (1 << np.arange(6)))
    for turn in (signs, signs | zero):
        path.write_text(krl_home(robot, home, turn))
        assert compensate_file(path, robot, exact(robot)).text == path.read_text()


def rapid_home(robot, home):
    return rapid(robot, np.radians([home, home]))


CONF = re.compile(r"\],\[(-?\d+), ?(-?\d+), ?(-?\d+), ?(\d)\],\[9E9")
ABB_HOMES = [
    [0, 0, 0, 0, 30, 0], [0, 10, 10, 0, 90, 0], [0, -10, 20, 0, -40, 0], [90, 0, 0, 0, 30, 0], [-90, 0, 0, 0, 30, 0],
    [0, 0, 0, 90, 30, 0], [0, 0, 0, -90, 30, 90], [0, 20, 0, 0, 60, 180], [0, 0, 0, 0, 45, -180], [0, 5, 5, 0, 80, 270],
]  # fmt: skip


@pytest.mark.parametrize("by", [0.86, -0.86])
@pytest.mark.parametrize("home", ABB_HOMES)
def test_confdata_says_the_corrected_quarters_and_the_file_can_be_read_again(home, by, tmp_path):
    robot = load_robot("abb-irb120")
    path = tmp_path / "home.mod"
    path.write_text(rapid_home(robot, home))
    done = compensate_file(path, robot, turned(robot, [by, 0, 0, by, 0, by]))
    expected = np.array(home, dtype=float) - [by, 0, 0, by, 0, by]
    quarters = [int(np.floor(expected[j] / 90)) for j in (0, 3, 5)]
    found = CONF.findall(done.text)
    assert len(found) == 2
    for *cf, cfx in found:
        assert [int(v) for v in cf] == quarters
        assert int(cfx) == int(home[4] < 0)
    path.write_text(done.text)
    assert CONF.findall(compensate_file(path, robot, exact(robot)).text) == found


def test_a_wrist_that_turns_over_changes_status_and_turn_together(tmp_path):
    """A5 from +0.3° to -0.3°: the sign of A5 is said twice, and both change."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "p.src"
    path.write_text(krl_home(robot, [10, -80, 100, 20, 0.3, 30]))
    before = words(path.read_text())
    status, turn = words(compensate_file(path, robot, turned(robot, [0, 0, 0, 0, 0.6, 0])).text)
    assert (before[0] ^ status, before[1] ^ turn) == (4, 16)


def test_binary_and_hexadecimal_words_keep_their_spelling(tmp_path):
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "p.src"
    text = krl_home(robot, [10, -80, 100, 0, 40, 30])
    status, turn = words(text)
    path.write_text(re.sub(r"S \d+,T \d+", f"S 'B{status:03b}',T 'B{turn:06b}'", text))
    moved = turned(robot, [0, 0, 0, 0.5, 0, 0])
    assert f"S 'B{status:03b}',T 'B{turn | 8:06b}'" in compensate_file(path, robot, moved).text
    path.write_text(re.sub(r"S \d+,T \d+", f"S 'H{status:X}',T 'H{turn:02X}'", text))
    assert f"S 'H{status:X}',T 'H{turn | 8:02X}'" in compensate_file(path, robot, moved).text


def test_a_real_robot_at_its_homes_stands_where_it_should(tmp_path):
    """All errors at once: read by the signs alone, the corrected homes are reached within a micrometre."""
    robot, real = bent("kuka-kr6-r700", seed=3)
    for home in HOMES:
        path = tmp_path / "home.src"
        path.write_text(krl_home(robot, home))
        done = compensate_file(path, robot, real)
        assert done.report.poses == 1
        assert not done.partly
        assert done.report.left_m < 2e-6
