"""The scripts beside a LeRobot arm: a session played and recorded, and joint zeros in the file that LeRobot reads."""

import json
import runpy
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.programs.verification import write_program
from planner.runs.loader import load_run
from tests.programs.sessions import PLAN_ID, static
from tests.test_examples import EXAMPLES

RECORD = SimpleNamespace(**runpy.run_path(str(EXAMPLES / "lerobot" / "record_poses.py")))
ZEROS = SimpleNamespace(**runpy.run_path(str(EXAMPLES / "lerobot" / "joint_zeros.py")))
NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")


class Servo:
    """A servo and LeRobot's count of it, written from LeRobot's own description of its Feetech bus.

    The encoder has 4096 steps a turn; Present_Position is the encoder's position less Homing_Offset; an angle in
    degrees is that less the middle of range_min and range_max, times 360 / 4095.
    """

    def __init__(self, calibration, true_zero):
        self.calibration, self.true_zero = calibration, true_zero  # encoder's step at which the joint truly is at zero
        self.encoder = 2047

    def shown(self):
        c = self.calibration
        return (self.encoder - c["homing_offset"] - (c["range_min"] + c["range_max"]) / 2) * 360 / 4095

    def drive(self, degrees):
        c = self.calibration
        goal = int(degrees * 4095 / 360 + (c["range_min"] + c["range_max"]) / 2)
        self.encoder = min(max(goal, c["range_min"]), c["range_max"]) + c["homing_offset"]

    @property
    def true_angle(self):
        return (self.encoder - self.true_zero) * 360 / 4096


class Arm:
    """As much of LeRobot's Robot as a session needs."""

    def __init__(self, servos):
        self.servos, self.sent = servos, []

    def get_observation(self):
        return {f"{name}.pos": s.shown() for name, s in self.servos.items()} | {"gripper.pos": 50.0}

    def send_action(self, action):
        self.sent.append(action)
        for key, value in action.items():
            self.servos[key.removesuffix(".pos")].drive(value)


def calibration(seed=0):
    """As LeRobot writes it, for an arm whose middles were taken by hand."""
    rng = np.random.default_rng(seed)
    out = {}
    for k, name in enumerate((*NAMES, "gripper"), start=1):
        half = int(rng.integers(1400, 1600))
        full = name == "wrist_roll"
        out[name] = {
            "id": k, "drive_mode": 0, "homing_offset": int(rng.integers(-900, 900)),
            "range_min": 0 if full else 2047 - half, "range_max": 4095 if full else 2047 + half,
        }  # fmt: skip
    return out


def arm_of(content, off):
    """An arm whose joints are truly at zero where it shows minus ``off`` degrees."""
    servos = {}
    for name in NAMES:
        c = content[name]
        middle = c["homing_offset"] + (c["range_min"] + c["range_max"]) / 2
        servos[name] = Servo(c, middle - off.get(name, 0.0) * 4096 / 360)
    return Arm(servos)


@pytest.fixture
def files(tmp_path):
    """A session of six poses in frames, as edbb writes it for five joints."""
    made = write_program(replace(static(n_poses=6, n_joints=5), joint_names=NAMES), "lerobot", "tour")
    for f in made:
        (tmp_path / f.name).write_text(f.text)
    return sorted(tmp_path / f.name for f in made)


def test_a_session_is_played_and_recorded(files, tmp_path):
    arm, typed = arm_of(calibration(), {}), []

    def type_in(question):
        typed.append(question)
        return "x" if len(typed) == 2 else "412.5"

    waits = []
    count = RECORD.record(arm, files, tmp_path / "run.csv", "length_mm", waits.append, type_in)
    assert count == 6
    run = load_run(tmp_path / "run.csv", 5)
    assert run.plan_id == PLAN_ID
    assert run.samples.pose.tolist() == [1, 2, 3, 4, 5, 6]
    np.testing.assert_allclose(run.samples.q_read, run.samples.q_cmd, atol=np.deg2rad(0.09))  # a step of the encoder
    np.testing.assert_allclose(run.readings.length, 0.4125)
    assert not run.continuous
    steps = np.diff([[a[f"{n}.pos"] for n in a_names(arm)] for a in arm.sent], axis=0)
    assert np.abs(steps).max() * 30 < 400  # no jump between frames or from file to file
    assert sum(waits) > 6


def a_names(arm):
    return [k.removesuffix(".pos") for k in arm.sent[0]]


def test_a_stopped_session_leaves_what_it_recorded(files, tmp_path):
    arm = arm_of(calibration(), {})

    def type_in(question):
        if question.startswith("pose 4"):
            raise KeyboardInterrupt
        return "400"

    with pytest.raises(KeyboardInterrupt):
        RECORD.record(arm, files, tmp_path / "run.csv", "length_mm", lambda _: None, type_in)
    assert load_run(tmp_path / "run.csv", 5).samples.pose.tolist() == [1, 2, 3]


def test_a_blocked_joint_is_said(files, tmp_path, capsys):
    arm = arm_of(calibration(), {})
    arm.servos["elbow_flex"].drive = lambda degrees: None
    RECORD.record(arm, files, tmp_path / "run.csv", None, lambda _: None, lambda _: "")
    assert "deg from its frame: is it blocked, or too weak?" in capsys.readouterr().out


def identification(path, zeros, axes_of="lerobot"):
    path.write_text(
        json.dumps(
            {
                "joint_zeros": [
                    {"joint": NAMES.index(n) + 1, "axes_of": axes_of, "zero_deg": v, "std_deg": 0.01, "absorbs": []}
                    for n, v in zeros.items()
                ],
                "problems": [],
            }
        )
    )
    return path


def run_zeros(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["joint_zeros.py", *map(str, words)])
    runpy.run_path(str(EXAMPLES / "lerobot" / "joint_zeros.py"), run_name="__main__")


FOUND = {"shoulder_lift": 2.31, "elbow_flex": -3.07, "wrist_flex": 0.6, "wrist_roll": -1.2}


def test_an_arm_with_the_new_file_shows_its_true_angles(tmp_path, monkeypatch, capsys):
    old = calibration(3)
    (tmp_path / "old.json").write_text(json.dumps(old, indent=4))
    words = (identification(tmp_path / "identification.json", FOUND), tmp_path / "old.json")
    robot = EXAMPLES.parent / "robots" / "so101" / "robot.toml"
    run_zeros(monkeypatch, *words, "--robot", robot, "-o", tmp_path / "new.json", "--map", tmp_path / "map.json")
    new = json.loads((tmp_path / "new.json").read_text())
    assert new.keys() == old.keys()
    assert all(new[n].keys() == {"id", "drive_mode", "homing_offset", "range_min", "range_max"} for n in new)
    assert new["gripper"] == old["gripper"]
    assert new["shoulder_pan"] == old["shoulder_pan"]
    assert "shoulder_pan: not shown by the run" in capsys.readouterr().out
    map_found = json.loads((tmp_path / "map.json").read_text())
    before, after = arm_of(old, FOUND), arm_of(old, FOUND)
    for name, servo in after.servos.items():
        servo.calibration = new[name]
    for state in (-40.0, 0.0, 55.0):
        for name in NAMES:
            before.servos[name].drive(state)
            assert before.servos[name].shown() + FOUND.get(name, 0.0) == pytest.approx(
                before.servos[name].true_angle, abs=0.05
            )
            mapped = map_found[name]["sign"] * before.servos[name].shown() + map_found[name]["offset_deg"]
            assert mapped == pytest.approx(before.servos[name].true_angle, abs=0.05)
            after.servos[name].drive(state)
            assert after.servos[name].true_angle == pytest.approx(state, abs=0.16)  # a tick, and half of one left


def test_an_arm_by_its_urdf_has_its_joints_by_that_file(tmp_path, monkeypatch, capsys):
    """``robot = "arm.urdf"``: the released robot.toml has no table of joints; some name them by numbers."""
    for names in (NAMES, "12345"):
        links = ["base", *(f"link{k}" for k in range(1, 6)), "flange"]
        joints = [(n, "revolute") for n in names] + [("mount", "fixed")]
        pairs = zip(links, links[1:], joints, strict=False)
        text = "".join(
            f'<joint name="{name}" type="{kind}"><parent link="{a}"/><child link="{b}"/></joint>'
            for a, b, (name, kind) in pairs
        )
        jaw = '<joint name="gripper" type="revolute"><parent link="link5"/><child link="jaw"/></joint>'
        (tmp_path / "robot.urdf").write_text(f"<robot name='a'>{jaw}{text}</robot>")
        (tmp_path / "robot.toml").write_text('urdf = "robot.urdf"\ntip = "flange"\n[parked]\ngripper_deg = 0.0\n')
        (tmp_path / "old.json").write_text(json.dumps(calibration(3)))
        found = identification(tmp_path / "identification.json", FOUND, None)
        words = [found, tmp_path / "old.json", "--robot", tmp_path / "robot.toml", "-o", tmp_path / "new.json"]
        if names != NAMES:
            with pytest.raises(SystemExit, match=r"no joint '2'.*--names"):
                run_zeros(monkeypatch, *words)
            with pytest.raises(SystemExit, match=r"--names: 1 names, but .* has 5 joints: 1, 2, 3, 4, 5"):
                run_zeros(monkeypatch, *words, "--names", "one")
            words += ["--names", *NAMES]
        run_zeros(monkeypatch, *words)
        assert json.loads((tmp_path / "new.json").read_text()) == ZEROS.shift_zeros(calibration(3), FOUND)[0]


def test_no_goal_lies_beyond_a_stop(tmp_path):
    old = calibration(5)
    new, left = ZEROS.shift_zeros(old, FOUND)
    assert max(map(abs, left.values())) <= 180 / 4095
    for name in FOUND:
        stops = [old[name][k] + old[name]["homing_offset"] for k in ("range_min", "range_max")]  # by the encoder
        ends = [new[name][k] + new[name]["homing_offset"] for k in ("range_min", "range_max")]
        if name != "wrist_roll":
            assert stops[0] <= ends[0] < ends[1] <= stops[1]


@pytest.mark.parametrize(
    ("zeros", "change", "said"),
    [
        ({"elbow_flex": 2.0}, {"homing_offset": -2040}, "homing_offset would be -2063"),
        ({"elbow_flex": 2.0}, {"range_min": 2040, "range_max": 2060}, "leaves no stroke"),
    ],
)
def test_a_zero_that_does_not_fit_is_refused(zeros, change, said):
    content = calibration()
    content["elbow_flex"] |= change
    with pytest.raises(SystemExit, match=said):
        ZEROS.shift_zeros(content, zeros)


def test_a_file_that_is_not_there_and_one_of_another_kind_are_named(tmp_path, monkeypatch):
    found = identification(tmp_path / "identification.json", FOUND)
    robot = EXAMPLES.parent / "robots" / "so101" / "robot.toml"
    for old, said in ((tmp_path / "none.json", "none.json: cannot be read"), (robot, "robot.toml: cannot be read")):
        with pytest.raises(SystemExit, match=said):
            run_zeros(monkeypatch, found, old, "--robot", robot, "-o", tmp_path / "new.json")


def test_where_lerobot_is_not_installed_that_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "lerobot", None)
    monkeypatch.setattr(sys, "argv", ["record_poses.py", "/dev/none", "a.csv", "-o", str(tmp_path / "run.csv")])
    with pytest.raises(SystemExit, match="LeRobot is not installed here"):
        RECORD.main()


def test_zeros_of_another_controller_are_refused(tmp_path):
    path = identification(tmp_path / "identification.json", FOUND, "urscript")
    with pytest.raises(SystemExit, match="axes of urscript, not of LeRobot's"):
        ZEROS.read_zeros(path, NAMES)


def test_a_sense_that_is_turned_stands_in_the_map():
    found = ZEROS.joint_map(("a", "b"), (1, -1), (0.0, 90.0), {"a": 1.5, "b": 2.0})
    assert found == {"a": {"sign": 1, "offset_deg": 1.5}, "b": {"sign": -1, "offset_deg": 88.0}}
    # c = sense · q + zero is what the robot's file says; the controller shows c − 2.0 where the zero is off by 2.0
    q = 30.0
    assert -1 * (-1 * q + 90.0 - 2.0) + 88.0 == q
