"""The log that a plan's own program keeps becomes its run."""

import re

import numpy as np
import pytest

from planner.runs.loader import load_runs
from tests.command import edbb
from tests.workflow.conftest import POSES


@pytest.mark.long
def test_the_log_of_a_plans_krl_program_is_its_run(resting, tmp_path):
    (dat,) = resting.folder.glob("*.dat")
    q = {p["id"]: np.array(p["q_deg"]) for p in resting.plan["poses"]}
    rng = np.random.default_rng(3)
    angles, gauge = [], ["pose,length_mm"]

    def fill(match):
        pose = int(match[2])
        angles.append(np.round(q[pose] + rng.normal(0, 1e-3, 6), 5))
        gauge.append(f"{pose},{400 + pose}")
        return match[1] + ",".join(f"A{k} {a}" for k, a in enumerate(angles[-1], start=1)) + match[3]

    zeros = ",".join(f"A{k} 0.0" for k in range(1, 7))
    text = re.sub(rf"(LOG_\w+\[\d+\]={{POSE (\d+),AX {{){zeros}(.*)", fill, dat.read_text())
    assert len(angles) > POSES
    (tmp_path / "log.dat").write_text(text)
    (tmp_path / "gauge.csv").write_text("\n".join(gauge))
    words = ("import", tmp_path / "log.dat", tmp_path / "gauge.csv")
    plan = ("--plan", resting.folder / "plan.json")
    done = edbb(*words, *plan, "--dialect", "krl", "-o", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    run = load_runs([tmp_path / "run.csv"], 6)
    assert run.plan_id == resting.plan["plan_id"]
    np.testing.assert_allclose(np.rad2deg(run.samples.q), np.array(angles), atol=1e-9)
    for wrong in (plan, ("--dialect", "krl"), (*plan, "--dialect", "krl", "--map", tmp_path / "m.toml")):
        done = edbb(*words, *wrong, "-o", tmp_path / "other.csv")
        assert done.returncode == 2
        assert "--dialect" in done.screen
