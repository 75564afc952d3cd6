"""From the plan to the robot's errors through a controller that counts its axes otherwise: sense, zero and coupling."""

import json
import re

import numpy as np
import pytest

from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_runs
from tests.command import edbb
from tests.workflow.conftest import FEWER, planned

pytestmark = pytest.mark.long  # a whole plan


SENSE, ZERO = np.array([-1, 1, -1, -1, -1, 1]), np.array([0, 0, -90, 0, 30, 0])
TABLE = f"""
[controllers.pdl2]
sense = {SENSE.tolist()}
zero_deg = {ZERO.tolist()}
coupling = [[3, 2, 1]]
source = "drawn for the test"
"""
TRUTH = """schema = "edbb-truth/1"
[errors]
a2_mm = 0.8
theta3_deg = 0.05
d4_mm = -0.4
theta5_mrad = -0.7
[noise]
gauge_um = 1.0
repeatability_mm = 0.001
"""


def shown(q_deg):
    c = SENSE * np.asarray(q_deg) + ZERO
    c[..., 2] += c[..., 1]
    return c


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("turned")
    robot = load_robot("kuka-kr6-r700").path.read_text()
    (folder / "robot.toml").write_text(robot + TABLE)
    own = ('robot = "kuka-kr6-r700"', 'robot = "robot.toml"')
    return planned("kuka-kr6-r700/edbb", folder, 36, "pdl2", changes=(*FEWER, own))


def test_the_program_says_what_the_pendant_shows(session):
    (program,) = session.folder.glob("*.pdl")
    said = re.findall(r"MOVE (?:TO )?\{([^}]*)\}|MOVE TO \{([^}]*)\}", program.read_text())
    angles = np.array([[float(v) for v in (a or b).split(",")] for a, b in said])
    for pose in session.plan["poses"]:
        if pose["role"] != "mount":
            assert np.abs(angles - shown(pose["q_deg"])).max(axis=1).min() < 6e-5


def test_the_log_of_the_program_gives_the_robots_errors(session, tmp_path):
    plan, out = session.folder / "plan.json", tmp_path
    (out / "truth.toml").write_text(TRUTH)
    done = edbb("simulate", plan, "-o", out / "run.csv", "--truth", out / "truth.toml")
    assert done.returncode == 0, done.stderr
    run = load_runs([out / "run.csv"], 6)
    c = shown(np.rad2deg(run.samples.q_read if run.samples.q_read is not None else run.samples.q))
    rows = zip(run.samples.pose.tolist(), c.tolist(), strict=True)
    (out / "log.csv").write_text("".join(f"{pose};" + ";".join(f"{v:.5f}" for v in row) + "\n" for pose, row in rows))
    lengths = zip(run.samples.pose.tolist(), run.readings.length.tolist(), strict=True)
    (out / "gauge.csv").write_text("pose,length_mm\n" + "".join(f"{p},{1e3 * v:.6f}\n" for p, v in lengths))
    done = edbb(
        "import", out / "log.csv", out / "gauge.csv", "--plan", plan, "--dialect", "pdl2", "-o", out / "own.csv"
    )
    assert done.returncode == 0, done.stderr
    own = load_runs([out / "own.csv"], 6)
    np.testing.assert_allclose(np.rad2deg(own.samples.q), np.rad2deg(run.samples.q), atol=2e-5)
    found = edbb(
        "identify",
        out / "own.csv",
        "--plan",
        plan,
        "--cell",
        plan.parent / "cell.toml",
        "--no-trace",
        "-o",
        out / "found",
        "--json",
    )
    assert found.returncode in (0, 5), found.stderr
    document = json.loads((out / "found" / "identification.json").read_text())
    estimates = {p["name"]: p for p in document["parameters"]}
    for name, wanted in (("a2", 0.8), ("d4", -0.4)):
        e = estimates[name]
        assert e["unit"] == "mm"
        assert abs(e["value"] - e["nominal"] - wanted) < 5 * e["std"], e
    zero = next(z for z in document["joint_zeros"] if z["joint"] == 3)
    assert abs(zero["zero_deg"] - 0.05) < 5 * zero["std_deg"]
