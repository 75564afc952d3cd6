"""What a person is told of targets that are corrected, and of those that cannot be."""

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from tests.compensation.robots import exact, flange_pose, regular_angles
from tests.compensation.test_cartesian import BASE, TOOL, frame_text, krl, matrix, poses_in


def joint_table(path, q):
    np.savetxt(path, np.degrees(q), delimiter=",", header=",".join(f"q{j}_deg" for j in range(1, 7)), comments="")
    return path


def test_joints_that_move_far_for_a_small_correction_are_named(kuka, tmp_path):
    """A wrist that is nearly straight: axes 4 and 6 make up for what a tenth of a degree at axis 5 would."""
    robot, real = kuka
    q = np.radians([[10, -80, 100, 20, 40, 30], [10, -80, 100, 20, 1.5, 30], [-20, -60, 80, 10, 50, 0]])
    done = compensate_file(joint_table(tmp_path / "t.csv", q), robot, real)
    printed = np.loadtxt(done.text.splitlines()[2:], delimiter=",")
    moved = printed - np.degrees(q)
    far = np.flatnonzero(np.abs(moved).max(axis=1) > 2.0)
    assert list(far) == [1]
    ((line, sentence),) = done.report.notes
    joint, by, millimetres = re.search(r"joint (\d) moves by (\S+)° for a correction of (\S+) mm", sentence).groups()
    assert line == 3
    assert float(by) == pytest.approx(moved[1, int(joint) - 1], abs=0.06)
    shift = flange_pose(exact(robot), np.radians(printed[1])) - flange_pose(exact(robot), q[1])
    assert float(millimetres) == pytest.approx(np.linalg.norm(shift[:3, 3]) * 1e3, abs=0.006)
    assert "t.csv:3: joint" in done.summary


def test_of_many_the_farthest_are_told_and_the_others_counted(kuka, tmp_path):
    robot, real = kuka
    q = np.radians([[10, -80, 100, 20, b, 30] for b in np.linspace(1.4, 2.0, 20)])
    done = compensate_file(joint_table(tmp_path / "t.csv", q), robot, real)
    moved = np.abs(np.loadtxt(done.text.splitlines()[2:], delimiter=",") - np.degrees(q)).max(axis=1)
    told = [line - 2 for line, s in done.report.notes if "moves by" in s and "over" not in s]
    assert len(told) == 8
    assert moved[told].min() >= np.delete(moved, told).max()
    (rest,) = [s for _, s in done.report.notes if "over 2°" in s]
    assert f"here and at {(moved > 2.0).sum() - 9} more targets" in rest


def test_angles_that_spell_almost_the_same_are_told(kuka, tmp_path):
    """At B = 90° only A - C counts: both change by tens of degrees where the tool turns by hundredths."""
    robot, real = kuka
    home = np.radians([[10, -80, 100, 20, 40, 30]])
    text = "\n".join(
        [
            "DEF P ( )",
            "$TOOL=" + frame_text(np.zeros(6)),
            "$BASE=" + frame_text(np.zeros(6)),
            "PTP {" + ",".join(f"A{i} {v:.6f}" for i, v in enumerate(np.degrees(home[0]), 1)) + "}",
            "LIN {X 450, Y 60, Z 350, A 0.0, B 90.0, C 0.0}",
            "LIN {X 440, Y 60, Z 340, A 0.0, B 70.0, C 10.0}",
            "END",
        ]
    )
    (tmp_path / "p.src").write_text(text)
    done = compensate_file(tmp_path / "p.src", robot, real)
    ((line, sentence),) = [n for n in done.report.notes if "B stands near 90°" in n[1]]
    was, is_ = np.array([0.0, 90.0, 0.0]), poses_in(done.text.replace(", ", ","))[0][3:]
    assert line == 5
    assert np.abs(is_ - was).max() > 1.0
    assert f"A 0.000 became {is_[0]:.3f} and C 0.000 became {is_[2]:.3f}" in sentence
    R = [matrix(np.array([0, 0, 0, *words]))[:3, :3] for words in (was, is_)]
    turned = np.degrees(np.arccos((np.trace(R[0].T @ R[1]) - 1) / 2))
    assert float(re.search(r"turns by (\S+)° in all", sentence)[1]) == pytest.approx(turned, abs=2e-3)
    assert turned < 0.5


def refused(path, robot, real):
    with pytest.raises(NoSolutionError) as caught:
        compensate_file(path, robot, real, strict=True)
    return str(caught.value)


def test_a_turn_that_the_pose_does_not_have_is_told_with_the_angle(kuka, tmp_path):
    robot, real = kuka
    q = np.radians([[10, -80, 100, 20, 40, 30]])
    text = krl(robot, q)
    assert ",T 2," in text
    (tmp_path / "p.src").write_text(text.replace(",T 2,", ",T 3,"))
    said = refused(tmp_path / "p.src", robot, real)
    assert "p.src:5: in the shape that is said joint 1 would stand at 10.00°, which is not in the turn" in said


def test_a_pose_without_turns_outside_the_limits_names_joint_and_limits(kuka, tmp_path):
    robot, real = kuka
    q = np.radians([[10, -80, 100, 20, 40, 30], [60, -80, 100, 20, 40, 30]])
    text = krl(robot, q[1:], "LIN", with_status=False)
    first = "PTP {" + ",".join(f"A{i} {v:.6f}" for i, v in enumerate(np.degrees(q[0]), 1)) + "}"
    (tmp_path / "p.src").write_text(text.replace("LIN", first + "\nLIN", 1))
    narrow = replace(robot, q_upper=np.where(np.arange(6) == 0, np.radians(45.0), robot.q_upper))
    said = refused(tmp_path / "p.src", narrow, real)
    where = "p.src:6: in the shape of the target before (line 5) joint 1 would stand at 60.00°; -170 … 45° are allowed"
    assert where in said
    assert "turns that are said" not in said


@pytest.mark.slow
def test_a_pose_after_one_that_is_not_reached_says_so(kuka, tmp_path):
    robot, real = kuka
    q = regular_angles(robot, 1, seed=7)
    text = krl(robot, q)
    far = "LIN {X 5000,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}\nLIN {X 450,Y 0,Z 300,A 0,B 60,C 0}"
    (tmp_path / "p.src").write_text(text.replace("END", f"PTP {far[4:]}\nEND"))
    said = refused(tmp_path / "p.src", robot, real)
    assert "p.src:7: it follows line 6, whose joint angles are not known" in said


def test_frames_that_are_not_said_name_the_options(kuka, tmp_path):
    robot, real = kuka
    text = re.sub(r"\$(TOOL|BASE)=.*\n", "", krl(robot, regular_angles(robot, 1, seed=7)))
    (tmp_path / "p.src").write_text(text)
    with pytest.raises(InputError, match=r"\(--frames\)\. .* name them yourself \(--tool, --base\)"):
        compensate_file(tmp_path / "p.src", robot, real)
    done = compensate_file(tmp_path / "p.src", robot, real, frames=ToolAndBase(matrix(TOOL), matrix(BASE)))
    assert done.report.poses == 1
