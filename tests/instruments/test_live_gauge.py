"""A gauge on a pseudo-terminal is read pose by pose of a plan; what was begun goes on."""

import contextlib
import json
import os
import threading
import time
import tty

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.instruments.centring.stop import SilentError, UnsettledError
from planner.instruments.live_gauge import LiveGauge, measure_poses, open_log
from planner.runs.loader import load_run
from planner.session.document import read_plan

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
        gauge.shown = LENGTHS[int(text.split()[1]) - 1] + (40.0 if text.startswith("pose 3") else 0.0)
        time.sleep(0.05)
        return next(answers)

    clock = iter(np.arange(0.0, 100.0, 2.5)).__next__
    said = list(measure_poses(open_log(tmp_path / "run.csv", *plan), live.read_settled_mean, ask, clock))
    assert said == ["pose 1: 401.500 mm (1 of 3)"]
    answers = iter(["", ""])
    said = list(measure_poses(open_log(tmp_path / "run.csv", *plan), live.read_settled_mean, ask, clock))
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
    said = list(measure_poses(log, read.__next__, ask, clock))
    assert [text.split(":")[0] for text in asked] == [
        "pose 1 at A, planned 401.50 mm", "pose 1", "pose 1", "pose 2 at A, planned 388.25 mm",
        "pose 3 at A, planned 455.00 mm",
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
