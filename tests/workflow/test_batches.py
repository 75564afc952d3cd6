"""Batches at one robot, as the how-to has them: plan, measure, identify, plan what tells most, identify all as one."""

import json

import pytest

from planner.model.identification_document import Identification
from tests.command import edbb
from tests.identification.few_draws import few_draws

TRUTH = """schema = "edbb-truth/1"
[errors]
a2_mm = 0.9
theta3_deg = 0.08
alpha4_urad = 900
zero_mm = 0.2
compliance2_urad_Nm = 8
[noise]
gauge_um = 2
repeatability_mm = 0.02
"""


def done(*words):
    found = edbb(*words)
    assert found.returncode == 0, found.stderr
    return found.screen


@pytest.mark.long
def test_two_batches_are_planned_measured_and_identified_as_one(tmp_path):
    truth, cell = tmp_path / "truth.toml", "kuka-kr6-r700/edbb"
    truth.write_text(TRUTH)
    first, second, known, both = (tmp_path / name for name in ("first", "second", "known", "both"))
    done("plan", cell, "--poses", "45", "--aim", "tracing", "-o", first)
    done("simulate", first / "plan.json", "--truth", truth, "-o", first / "run.csv")
    with few_draws():
        done("identify", first / "run.csv", "--plan", first / "plan.json", "-o", known)
    done("plan", cell, "--after", known, "--poses", "20", "-o", second)
    foreseen = json.loads((second / "plan.json").read_text())["foresight"]
    assert 0.0 < foreseen["error_mm"] < 1e3 * Identification.read(known / "identification.json").workspace_error
    done("simulate", second / "plan.json", "--truth", truth, "-o", second / "run.csv")
    with few_draws():
        done("identify", first / "run.csv", second / "run.csv", "-o", both)
    before, after = (Identification.read(f / "identification.json") for f in (known, both))
    assert {f.name for f in after.frames.fixtures} == {"first/A", "second/A"}
    assert after.workspace_error < before.workspace_error
    assert not [f for f in after.findings if f.between_sessions]
    poses = [json.loads((f / "plan.json").read_text())["poses"] for f in (first, second)]
    counted = sum(p["role"] == "validate" for plan in poses for p in plan)
    assert after.n_validation == counted > 0
