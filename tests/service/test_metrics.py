"""What monitoring reads is what promtool takes, and counts what there is."""

import re
import shutil
import subprocess

import pytest

from planner.service.metrics import MEDIA_TYPE, Metric
from tests.service.conftest import client_of
from tests.service.test_keeping import CALIBRATION, Plant

PROMTOOL = shutil.which("promtool")
SAMPLE = re.compile(r'([a-z_]+)(?:\{((?:[a-z_]+="(?:[^"\\]|\\.)*",?)*)\})? (-?[0-9.e+-]+)')


def read(text):
    """Values by name and labels, by a reader of its own of the text format."""
    found = {}
    for line in text.splitlines():
        if not line.startswith("#"):
            name, labels, value = SAMPLE.fullmatch(line).groups()
            found[name, tuple(sorted(re.findall(r'([a-z_]+)="((?:[^"\\]|\\.)*)"', labels or "")))] = float(value)
    return found


@pytest.fixture
def answer(tmp_path):
    plant = Plant(tmp_path)
    plant.run("a", outputs=[("plan.json", b"plan")])
    plant.run("b", outputs=[("plan.json", b"plan"), ("log", b"12345678")])
    plant.run("c", state="failed")
    plant.run("d", "identification", outputs=[("identification.json", CALIBRATION)])
    plant.record()
    plant.run("e", state="queued")
    with plant.db.write() as db:
        db.execute("UPDATE jobs SET started = 100, finished = 107.5 WHERE title = 'plan a'")
        db.execute("UPDATE jobs SET started = 100, finished = 102 WHERE title = 'plan b'")
        db.execute("UPDATE jobs SET created = created - 60 WHERE title = 'plan e'")
    with client_of(tmp_path, workers=0, beside=0) as client:
        yield client.get("/metrics")


@pytest.mark.slow
def test_it_counts_what_there_is(answer):
    assert answer.headers["content-type"] == MEDIA_TYPE
    found = read(answer.text)
    jobs = {labels: value for (name, labels), value in found.items() if name == "edbb_jobs"}
    assert jobs == {
        (("kind", "plan"), ("state", "done")): 2, (("kind", "plan"), ("state", "failed")): 1,
        (("kind", "plan"), ("state", "queued")): 1, (("kind", "identification"), ("state", "done")): 1,
    }  # fmt: skip
    assert found["edbb_job_run_seconds", (("kind", "plan"),)] == 9.5
    assert found["edbb_job_runs", (("kind", "plan"),)] == 2
    assert found["edbb_files_bytes", ()] == 4 + 8 + len(CALIBRATION)
    assert 60 <= found["edbb_oldest_waiting_seconds", ()] < 120
    states = {dict(labels)["state"]: value for (name, labels), value in found.items() if name == "edbb_robots"}
    assert states == {"good": 1, "check due": 0, "changed": 0, "not calibrated": 0, "damaged": 0} | {
        "never measured": 0, "withdrawn": 0,
    }  # fmt: skip


def test_a_label_may_hold_anything():
    line = list(Metric("edbb_x", "gauge", "A thing.", [((("kind", 'a "b" \\ c\nd'),), 1.0)]).lines())[-1]
    assert line == r'edbb_x{kind="a \"b\" \\ c\nd"} 1.0'


@pytest.mark.slow
@pytest.mark.skipif(PROMTOOL is None, reason="there is no promtool here")
def test_promtool_takes_it(answer):
    done = subprocess.run(
        [PROMTOOL, "check", "metrics"], input=answer.text, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
