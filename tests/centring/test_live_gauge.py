"""A gauge on a pseudo-terminal is read pose by pose of a plan; what was begun goes on."""

import contextlib
import json
import os
import threading
import time

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.centring.live_session import LiveGauge, MeasuringSession, open_log, program_remark
from planner.centring.stop import SilentError, UnsettledError
from planner.common.errors import InputError
from planner.runs.loader import load_run
from planner.session.document import read_plan
from tests.common.test_exchange import windows
from tests.not_everywhere import tty

FIXTURES = (windows,)
LENGTHS = [401.5, 388.25, 455.0]


class Gauge:
    """Sends what it shows all the time; ``shaking`` [mm]."""

    def __init__(self, shaking=0.0):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port, self.shown, self.shaking, self.on = os.ttyname(slave), 400.0, shaking, True
        self.rng = np.random.default_rng(0)
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while self.on:
            with contextlib.suppress(OSError):
                os.write(self.master, f"L={self.shown + self.shaking * self.rng.normal():+10.3f} mm\r\n".encode())
            time.sleep(0.002)


@pytest.fixture
def gauge():
    made = Gauge()
    yield made
    made.on = False


@pytest.fixture
def plan(tmp_path):
    cell = load_cell("ur5e/edbb")
    poses = [
        {
            "id": k,
            "q_deg": [10.0 * k] * 6,
            "length_mm": length,
            "fixture": "A",
            "approach": [1] * 6,
            "role": "calibrate",
        }
        for k, length in enumerate(LENGTHS, 1)
    ]
    content = {"schema": "edbb-plan/1", "plan_id": "0123456789ab", "robot": "ur5e", "cell": "ur5e/edbb", "poses": poses}
    (tmp_path / "plan.json").write_text(json.dumps(content))
    return read_plan(tmp_path / "plan.json", "robot", "poses"), cell


def test_poses_are_ticked_off_and_a_run_that_was_begun_goes_on(plan, gauge, tmp_path):
    live, answers = LiveGauge(gauge.port, 9600), iter(["", "s", "q"])

    def ask(text):
        if text.startswith("pose"):
            gauge.shown = LENGTHS[int(text.split()[1]) - 1] + (40.0 if text.startswith("pose 3") else 0.0)
        time.sleep(0.05)
        return next(answers)

    clock = iter(np.arange(0.0, 100.0, 2.5)).__next__
    said = list(MeasuringSession(open_log(tmp_path / "run.csv", *plan), ask, clock, live.read_settled_mean).run())
    assert said == ["pose 1: 401.500 mm (1 of 3)"]
    answers = iter(["", "", "q"])
    said = list(MeasuringSession(open_log(tmp_path / "run.csv", *plan), ask, clock, live.read_settled_mean).run())
    assert said[0] == "pose 2: 388.250 mm (2 of 3)"
    assert "pose 3: 495.000 mm, +40.0 mm from the plan: is this the pose" in said[1]
    run = load_run(tmp_path / "run.csv", 6)
    np.testing.assert_allclose(run.readings.length, [0.4015, 0.38825, 0.495], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(run.samples.q[:, 0]), [10, 20, 30], atol=1e-6)
    assert run.samples.pose.tolist() == [1, 2, 3]
    assert run.plan_id == "0123456789ab"
    assert (np.diff(run.samples.t) > 0).all()
    assert (run.samples.direction == 1).all()
    with pytest.raises(InputError, match="no run of plan ba9876543210"):
        open_log(tmp_path / "run.csv", plan[0].model_copy(update={"plan_id": "ba9876543210"}), plan[1])


def test_what_the_gauge_cannot_have_read_is_not_kept(plan, tmp_path):
    """An error's number, a bar that was pulled off; and a gauge that hangs is named."""
    read, asked = iter([1.0e-3, 0.61, 0.4015, 0.4015, 0.4015]), []
    log = open_log(tmp_path / "run.csv", *plan)

    def ask(text):
        asked.append(text)
        return ""

    clock = iter(np.arange(0.0, 100.0, 2.5)).__next__
    said = list(MeasuringSession(log, ask, clock, read.__next__).run())
    assert [text.split(":")[0] for text in asked] == [
        "pose 1 of 3 at A, planned 401.50 mm", "pose 1", "pose 1", "pose 2 of 3 at A, planned 388.25 mm",
        "pose 3 of 3 at A, planned 455.00 mm", "behind the last pose",
    ]  # fmt: skip
    assert "1.000 mm is beyond the gauge's range and not kept" in asked[1]
    assert load_run(tmp_path / "run.csv", 6).readings.length == pytest.approx([0.4015] * 3)
    assert ["does it still move" in text for text in said] == [False, False, True]


def test_a_gauge_that_shakes_or_is_silent_is_told(gauge):
    gauge.shaking = 1.0
    with pytest.raises(UnsettledError, match="still spread over"):
        LiveGauge(gauge.port, 9600).read_settled_mean()
    gauge.on = False
    quiet = Gauge()
    quiet.on = False
    time.sleep(0.05)
    silent = LiveGauge(quiet.port, 9600)
    silent.line.reset_input_buffer()
    with pytest.raises(SilentError, match="are --baud and --protocol its own"):
        silent.read()
    with pytest.raises(InputError, match="cannot be opened"):
        LiveGauge("/dev/nothing", 9600)


def typed(log, answers):
    """What is asked and said where a person types these answers, a minute after each other."""
    asked, answers = [], iter(answers)

    def ask(text):
        asked.append(text)
        return next(answers)

    clock = iter(np.arange(0.0, 6000.0, 60.0)).__next__
    return asked, list(MeasuringSession(log, ask, clock).run())


def test_a_person_types_what_the_gauge_shows_and_corrects_it(plan, tmp_path):
    """Typed wrongly and put right by `b`; a pose left out is named, and read later by its number."""
    log = open_log(tmp_path / "run.csv", *plan)
    asked, said = typed(log, ["402.5", "b", "401,5 mm", "x", "", "s", "455", "q"])
    assert asked[0].startswith("pose 1 of 3 at A, planned 401.50 mm: type what the gauge shows in mm")
    assert [text.split(":")[0] for text in asked[1:4]] == [
        "pose 2 of 3 at A, planned 388.25 mm", "pose 1 of 3 at A, planned 401.50 mm",
        "pose 2 of 3 at A, planned 388.25 mm",
    ]  # fmt: skip
    assert "'x' is no answer here" in asked[4]
    assert "'' is no answer here" in asked[5]
    assert said[1].startswith("pose 1: 401.500 mm in place of 402.500 mm (1 of 3)")
    assert said[-1].startswith("not read yet: pose 2; ")
    first = load_run(tmp_path / "run.csv", 6)
    assert first.samples.pose.tolist() == [1, 3]
    assert first.samples.t[0] == pytest.approx(60.0)  # the correction has the time of the pose, not its own
    typed(open_log(tmp_path / "run.csv", *plan), ["p 3", "455.75", "388.25", "b", "455.25", ""])
    run = load_run(tmp_path / "run.csv", 6)
    assert dict(zip(run.samples.pose.tolist(), run.readings.length, strict=True)) == pytest.approx(
        {1: 0.4015, 2: 0.38825, 3: 0.45525}
    )
    assert (np.diff(run.samples.t) > 0).all()


def test_a_reading_is_asked_for_again_while_another_program_has_the_run_open(plan, tmp_path, windows):
    log, asked, answers = open_log(tmp_path / "run.csv", *plan), [], iter(["401.5", "388.25", "388.3", "q"])

    def ask(text):
        asked.append(text.partition(" of")[0])
        windows.open_file = tmp_path / "run.csv" if len(asked) == 2 else None
        return next(answers)

    said = list(MeasuringSession(log, ask, iter(np.arange(0.0, 100.0, 2.5)).__next__).run())
    assert asked == ["pose 1", "pose 2", "pose 2", "pose 3"]
    assert "another program has it open" in said[1]
    assert said[2] == "pose 2: 388.300 mm (2 of 3)"
    assert load_run(tmp_path / "run.csv").readings.length * 1e3 == pytest.approx([401.5, 388.3])


def test_a_pose_is_read_again_by_its_number_and_a_port_gives_it_a_new_time(plan, tmp_path):
    log = open_log(tmp_path / "run.csv", *plan)
    read, answers = iter([0.4015, 0.3880, 0.38825]).__next__, iter(["", "", "p 2", "", "q"]).__next__
    clock = iter(np.arange(0.0, 100.0, 10.0)).__next__
    said = list(MeasuringSession(log, lambda _: answers(), clock, read).run())
    assert said[-1].startswith("pose 2: 388.250 mm in place of 388.000 mm (2 of 3)")
    assert log.rows == {1: (10.0, 0.4015), 2: (30.0, 0.38825)}


def test_who_measures_is_told_whether_the_program_waits():
    assert "stops at each pose and names it by the same number" in program_remark("hand")
    assert 'does not wait for a person (read_by = "log")' in program_remark("log")
