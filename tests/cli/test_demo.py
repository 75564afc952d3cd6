"""``edbb demo``, to its end: whole folders, and an answer that its own findings bear out."""

import json
import re

import pytest

from planner.cell.reading import load_cell
from planner.common.files import data_folder
from planner.session.document import read_plan
from planner.session.movable_cell import cell_files
from planner.session.planned_session import load_session
from planner.workflow.demo import CELL, SHIPPED
from planner.workflow.plan_results import PlanResult
from planner.workflow.planning import plan
from tests.command import edbb
from tests.not_everywhere import require_planning
from tests.test_planning_packages import edbb_without
from tests.workflow.conftest import FEWER, small_cell

READY = data_folder("robots") / SHIPPED


def test_the_shipped_plan_is_of_the_shipped_cell():
    """Where it is not any more, the plan is made anew as CONTRIBUTING.md says."""
    session = load_session(READY, "simulated", check=True)
    assert session.notes == ()
    assert cell_files(load_cell(CELL)) == {"cell.toml": (READY.parent / "cell.toml").read_bytes()}


@pytest.mark.long
def test_the_shipped_plan_is_as_good_as_one_of_today():
    require_planning()
    result = plan(CELL)
    assert isinstance(result, PlanResult)
    shipped, made = read_plan(READY), result.document()
    assert len(shipped.poses) == len(made.poses)
    assert shipped.parameters == made.parameters
    assert shipped.foresight.error_mm == pytest.approx(made.foresight.error_mm, rel=0.05)
    assert shipped.trajectory.duration_s == pytest.approx(made.trajectory.duration_s, rel=0.1)


@pytest.mark.long
def test_where_nobody_can_plan_the_demo_takes_the_shipped_plan(tmp_path):
    """Its screen says so, and the command that it names works there."""
    done = edbb_without("demo", "--no-open", "-o", "demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "packages of planning are not installed here" in done.stdout
    for file in ("plan.json", "cell.toml"):
        assert (tmp_path / "demo" / "session" / file).read_bytes() == (READY.parent / file).read_bytes()
    assert (tmp_path / "demo" / "calibrated" / "report.html").stat().st_size > 0
    words = re.search(r"next +edbb (.*) writes its program", done.stdout)[1].split()
    assert edbb_without(*words, cwd=tmp_path).returncode == 0


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
    assert 500 <= said["hidden"]["size_urad"] <= 900
    (drawn,) = re.findall(r"^# truth: effects = \[(.*)\]$", (out / "run.csv").read_text(), re.MULTILINE)
    assert drawn.count("gear error curve") == 6  # the robot is one that the plan expects
    assert f'"{said["hidden"]["effect"]}", on = "{said["hidden"]["on"]}"' in drawn  # and has the fault
    document = json.loads((out / "calibrated" / "identification.json").read_text())
    hidden = f"{said['hidden']['effect']}, {said['hidden']['on']}"
    each = [m for f in document["findings"] for m in f.get("members", [f])]
    names = [n for f in each for n in (f"{f['effect']}, {f['on']}", *f["rivals"])]
    assert said["found"] == (hidden in names or f"gear error curve, {said['hidden']['on']}" in names)
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
