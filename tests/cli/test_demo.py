"""``edbb demo``, to its end: whole folders, and an answer that its own findings bear out."""

import json
import re

import pytest

from tests.command import edbb
from tests.workflow.conftest import FEWER, small_cell


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 5])
def test_the_demo_runs_to_its_end(tmp_path, seed):
    cell, out = small_cell("kuka-kr6-r700/edbb", tmp_path, *FEWER), tmp_path / "demo"
    done = edbb("demo", cell, "--poses", "36", "--seed", seed, "--no-open", "-o", out, "--json")
    assert done.returncode == 0, done.stderr
    for file in (
        "session/plan.json",
        "session/report.html",
        "run.csv",
        "calibrated/robot.toml",
        "calibrated/report.html",
    ):
        assert (out / file).stat().st_size > 0
    said = json.loads(done.stdout)
    assert said == json.loads((out / "demo.json").read_text())
    assert said["simulated"] is True
    assert 200 <= said["hidden"]["size_urad"] <= 400
    (drawn,) = re.findall(r"^# truth: effects = \[(.*)\]$", (out / "run.csv").read_text(), re.MULTILINE)
    assert drawn.count("gear error curve") == 6  # the robot is one that the plan expects
    assert f'"{said["hidden"]["effect"]}", on = "{said["hidden"]["on"]}"' in drawn  # and has the fault
    document = json.loads((out / "calibrated" / "identification.json").read_text())
    hidden = f"{said['hidden']['effect']}, {said['hidden']['on']}"
    each = [m for f in document["findings"] for m in f.get("members", [f])]
    names = [n for f in each for n in (f"{f['effect']}, {f['on']}", *f["rivals"])]
    assert said["found"] == (hidden in names)
    assert document["simulated"] is True
    assert document["known_anywhere_mm"] < document["release"]["nominal_anywhere_mm"]


@pytest.mark.long
def test_the_demo_says_what_came_of_the_fault(tmp_path):
    """In words, and the command that it names works."""
    cell, out = small_cell("kuka-kr6-r700/edbb", tmp_path, *FEWER), tmp_path / "demo"
    done = edbb("demo", cell, "--poses", "36", "--seed", "2", "--no-open", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "SIMULATED: nobody has measured this robot" in done.screen
    found = json.loads((out / "demo.json").read_text())["found"]
    assert ("was not found" in done.screen) == (not found)
    assert "edbb robots" in done.screen
    assert edbb("robots").returncode == 0
