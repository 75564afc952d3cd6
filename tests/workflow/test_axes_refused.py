"""A language of which the robot's file says nothing is refused by every command, with the lines to add."""

import pytest

from planner.kinematics.robot_reader import load_robot
from planner.kinematics.robot_writer import RobotCorrections, write_robot
from planner.session.point_poses import BarPoses
from tests.command import edbb

ADD = ("[controllers.", "same = true", "sense = [1, 1, 1, 1, 1, 1]", "robot.md", "kuka-kr6-r700/robot.toml")


def check_refused(done, language):
    assert done.returncode == 2, done.stderr
    said = "".join(done.screen.split())
    assert all("".join(word.split()) in said for word in (*ADD, f"[controllers.{language}]"))


def test_planning_ends_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(BarPoses, "draw", lambda *_: pytest.fail("poses are drawn"))
    done = edbb("plan", "kuka-kr6-r700/edbb", "-o", tmp_path / "out", "--dialect", "krl", "--dialect", "urscript")
    check_refused(done, "urscript")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_export_and_import_are_refused(resting, tmp_path):
    plan = resting.folder / "plan.json"
    check_refused(edbb("export", plan, "--dialect", "rapid", "-o", tmp_path / "a.mod"), "rapid")
    assert not (tmp_path / "a.mod").exists()
    (tmp_path / "log.csv").write_text("".join(f"{k};1;2;3;4;5;6\n" for k in range(1, 4)))
    (tmp_path / "gauge.csv").write_text("pose,length_mm\n1,400\n2,401\n3,402\n")
    words = ("import", tmp_path / "log.csv", tmp_path / "gauge.csv", "--plan", plan)
    check_refused(edbb(*words, "--dialect", "rapid", "-o", tmp_path / "run.csv"), "rapid")
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.parametrize(
    ("name", "language", "text"),
    [
        ("p.script", "urscript", "def p():\n  movej([d2r(0), d2r(-90), d2r(90), d2r(0), d2r(40), d2r(0)], v=1)\nend\n"),
        ("p.pdl", "pdl2", "PROGRAM p HOLD\nBEGIN\n  MOVE TO {0, -90, 90, 0, 40, 0}\nEND p\n"),
        ("t.csv", "rapid", "# axes_of: rapid\nq1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-90,90,0,40,0\n"),
    ],
)
def test_a_correction_is_refused(name, language, text, tmp_path):
    robot = load_robot("kuka-kr6-r700")
    made = dict(write_robot(robot, RobotCorrections((("a2", 0.3158),), (), None, "a fit.")))
    model = tmp_path / "kuka-kr6-r700"
    model.mkdir()
    (model / "robot.toml").write_text(made["robot.toml"])
    (tmp_path / name).write_text(text)
    done = edbb("compensate", tmp_path / name, "--model", model / "robot.toml", "-o", tmp_path / f"new_{name}")
    check_refused(done, language)
    assert not (tmp_path / f"new_{name}").exists()
