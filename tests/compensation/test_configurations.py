"""Status, turn and confdata: kept as written where the corrected joints allow it, renewed where they do not."""

import re

import numpy as np
import pytest

from planner.compensation.compensated_file import compensate_file
from planner.kinematics.robot_reader import load_robot
from tests.compensation.robots import BentRobot, bent, exact, flange_pose
from tests.compensation.test_cartesian import abc_of, frame_text, kuka_status, rapid

NO_FRAMES = f"$TOOL={frame_text(np.zeros(6))}\n$BASE={frame_text(np.zeros(6))}\n"
HOMES = [
    [0, -90, 90, 0, 60, 0], [0, -90, 90, 0, -60, 0], [0, -90, 90, 180, 60, 0], [90, -80, 100, 0, 45, 0],
    [0, -70, 100, 0, 30, 0], [0, -60, 80, 0, 90, 0], [-90, -90, 90, 0, 50, 0], [0, -100, 110, 0, 70, 180],
    [0, -45, 60, 90, 40, -90], [0, -90, 120, -90, 30, 0],
]  # fmt: skip


def turned(robot, angles):
    """A robot whose joints stand further by ``angles`` [deg] than the controller believes."""
    by_joint = robot.coupling_matrix @ np.radians(angles)
    delta = [0.0 if t.joint is None else by_joint[t.joint] for t in robot.transforms]
    return BentRobot(robot, np.array(delta))


def krl_homes(robot, homes, turns=None):
    rows = []
    for k, home in enumerate(homes):
        q = np.radians(home)
        x = abc_of(flange_pose(exact(robot), q))
        numbers = ",".join(f"{c} {v:.3f}" for c, v in zip("XYZABC", x, strict=True))
        rows.append(f"PTP {{{numbers},S {kuka_status(robot, q)},T {signs(home) if turns is None else turns[k]}}}\n")
    return f"DEF P ( )\n{NO_FRAMES}{''.join(rows)}END\n"


def signs(angles):
    return int((np.array(angles) < 0) @ (1 << np.arange(6)))


def words(text):
    return [(int(s), int(t)) for s, t in re.findall(r"S (\d+),T (\d+)", text)]


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.08, -0.08, 0.9, -0.9])
def test_turn_bits_say_the_corrected_joints_and_the_file_can_be_read_again(by, tmp_path):
    """A4 at 0 corrected to -0.08°: its bit is set, and no other."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "home.src"
    path.write_text(krl_homes(robot, HOMES))
    done = compensate_file(path, robot, turned(robot, [by, 0, 0, by, 0, by]))
    expected = np.array(HOMES, dtype=float) - [by, 0, 0, by, 0, by]
    status = [s for s, _ in words(krl_homes(robot, HOMES))]
    assert words(done.text) == list(zip(status, map(signs, expected), strict=True))
    path.write_text(done.text)
    assert compensate_file(path, robot, exact(robot)).text == done.text


@pytest.mark.slow
def test_what_is_written_stays_where_the_joint_is_still_at_its_border(tmp_path):
    """At exactly 0° either bit names the joint: no correction, no change, whichever was taught."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "home.src"
    zero = (np.array(HOMES) == 0) @ (1 << np.arange(6))
    for turns in ([signs(h) for h in HOMES], [signs(h) | int(z) for h, z in zip(HOMES, zero, strict=True)]):
        path.write_text(krl_homes(robot, HOMES, turns))
        assert compensate_file(path, robot, exact(robot)).text == path.read_text()


CONF = re.compile(r"\],\[(-?\d+), ?(-?\d+), ?(-?\d+), ?(\d)\],\[9E9")
ABB_HOMES = [
    [0, 0, 0, 0, 30, 0], [0, 10, 10, 0, 90, 0], [0, -10, 20, 0, -40, 0], [90, 0, 0, 0, 30, 0], [-90, 0, 0, 0, 30, 0],
    [0, 0, 0, 90, 30, 0], [0, 0, 0, -90, 30, 90], [0, 20, 0, 0, 60, 180], [0, 0, 0, 0, 45, -180], [0, 5, 5, 0, 80, 270],
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.86, -0.86])
def test_confdata_says_the_corrected_quarters_and_the_file_can_be_read_again(by, tmp_path):
    robot = load_robot("abb-irb120")
    path = tmp_path / "home.mod"
    homes = [*ABB_HOMES[::2], *ABB_HOMES[1::2]]
    path.write_text(rapid(robot, np.radians(homes)))
    taught = CONF.findall(path.read_text())
    done = compensate_file(path, robot, turned(robot, [by, 0, 0, by, 0, by]))
    found = CONF.findall(done.text)
    expected = []
    for written in taught:  # the file declares some of its points ahead of the others: known again by their words
        home = next(h for h in homes if conf_of(h) == tuple(map(int, written)))
        expected.append(conf_of(np.array(home, dtype=float) - [by, 0, 0, by, 0, by]))
    assert [tuple(map(int, row)) for row in found] == expected
    path.write_text(done.text)
    assert CONF.findall(compensate_file(path, robot, exact(robot)).text) == found


def conf_of(q_deg):
    return (*(int(np.floor(q_deg[j] / 90)) for j in (0, 3, 5)), int(q_deg[4] < 0))


def test_a_wrist_that_turns_over_changes_status_and_turn_together(tmp_path):
    """A5 from +0.3° to -0.3°: the sign of A5 is said twice, and both change."""
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "p.src"
    path.write_text(krl_homes(robot, [[10, -80, 100, 20, 0.3, 30]]))
    ((before, turned_before),) = words(path.read_text())
    ((status, turn),) = words(compensate_file(path, robot, turned(robot, [0, 0, 0, 0, 0.6, 0])).text)
    assert (before ^ status, turned_before ^ turn) == (4, 16)


def test_binary_and_hexadecimal_words_keep_their_spelling(tmp_path):
    robot = load_robot("kuka-kr6-r700")
    path = tmp_path / "p.src"
    text = krl_homes(robot, [[10, -80, 100, 0, 40, 30]])
    ((status, turn),) = words(text)
    path.write_text(re.sub(r"S \d+,T \d+", f"S 'B{status:03b}',T 'B{turn:06b}'", text))
    moved = turned(robot, [0, 0, 0, 0.5, 0, 0])
    assert f"S 'B{status:03b}',T 'B{turn | 8:06b}'" in compensate_file(path, robot, moved).text
    path.write_text(re.sub(r"S \d+,T \d+", f"S 'H{status:X}',T 'H{turn:02X}'", text))
    assert f"S 'H{status:X}',T 'H{turn | 8:02X}'" in compensate_file(path, robot, moved).text


def test_a_real_robot_at_its_homes_stands_where_it_should(tmp_path):
    """All errors at once: read by the signs alone, the corrected homes are reached within a micrometre."""
    robot, real = bent("kuka-kr6-r700", seed=3)
    path = tmp_path / "home.src"
    path.write_text(krl_homes(robot, HOMES))
    done = compensate_file(path, robot, real)
    assert done.report.poses == len(HOMES)
    assert not done.partly
    assert done.report.left_m < 2e-6
