"""The examples run as they stand, and the public interface is light and whole."""

import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import planner
from planner.common.result import Result
from tests.identification.few_draws import few_draws
from tests.simulation.made import wide_plan
from tests.studies.conftest import shrink
from tests.workflow.conftest import FEWER, small_cell

EXAMPLES = Path(__file__).parent.parent / "examples"
USED = {"coal", "pinocchio", "polars", "scipy.interpolate", "scipy.ndimage", "scipy.optimize"}  # by the call itself
HEAVY = {*USED, "ompl", "fcl", "highspy", "matplotlib", "plotly", "scipy.stats"}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example as it stands, in an empty folder; returns what it printed."""

    def run_script(name, *words):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, words)])
        with few_draws():
            runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        return capsys.readouterr().out

    return run_script


def test_every_example_is_tried_here():
    tried = {"seed_cell", "own_urdf", "own_run", "fixture_place", "custom_effect"}
    assert {p.stem for p in EXAMPLES.glob("*.py")} == tried


@pytest.mark.long
def test_a_run_of_ones_own(run, tmp_path):
    text = run("own_run", tmp_path / "out")
    assert "95 of 100 targets" in text
    assert (tmp_path / "out" / "robot.toml").is_file()
    assert (tmp_path / "out" / "errors.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_an_effect_of_ones_own_is_found(tmp_path):
    """In a process of its own: the effect that it registers stays there."""
    script = [sys.executable, EXAMPLES / "custom_effect.py", wide_plan(tmp_path, calibrate=90), tmp_path / "out"]
    done = subprocess.run(script, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    text = done.stdout
    assert "hose pull, joint 2 by joint 4" in text.lower()
    found = json.loads((tmp_path / "out" / "identification.json").read_text())["findings"]
    assert [(f["effect"], f["on"]) for f in found] == [("hose pull", "joint 2 by joint 4")]


@pytest.mark.long
def test_the_seed_cell_from_plan_to_corrected_program(run, tmp_path):
    cell = small_cell("kuka-kr6-r700/edbb", tmp_path, *FEWER)
    text = run("seed_cell", tmp_path / "out", cell, 34)
    assert "nearest bodies" in text
    assert "corrected" in text
    assert (tmp_path / "out" / "calibrated" / "robot.toml").is_file()


@pytest.mark.long
def test_an_arm_of_ones_own(run, tmp_path):
    assert "arm: 6 joints" in run("own_urdf", tmp_path / "out")
    assert (tmp_path / "out" / "plan.json").is_file()


@pytest.mark.long
def test_the_place_of_a_fixture(run, tmp_path, monkeypatch):
    shrink(monkeypatch)
    run("fixture_place", tmp_path / "out", "kuka-kr6-r700/edbb")
    assert (tmp_path / "out" / "places.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", [n for n in planner.__all__ if n != "__version__"])
def test_every_public_name_is_there_and_documented(name):
    assert getattr(planner, name).__doc__


def test_results_share_one_face():
    for name in [n for n in planner.__all__ if n.endswith("Result") and n not in ("Result", "ExportResult")]:
        assert issubclass(getattr(planner, name), Result)


def test_the_python_of_the_pages_uses_what_there_is():
    page = (EXAMPLES.parent / "docs" / "python.md").read_text()
    text = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0]
    names = re.search(r"from planner import (.*)", text)[1].split(", ")
    assert set(names) <= set(planner.__all__)
    compile(text, "python.md", "exec")
    for result, method in re.findall(r"^(?:\w+ = )?(session|robot)\.(\w+)", text, re.MULTILINE):
        assert hasattr({"session": planner.PlanResult, "robot": planner.CalibrationResult}[result], method)


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match="no attribute 'plann'"):
        _ = planner.plann


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "unused"),
    [("import planner", {*HEAVY, *USED, "numpy", "scipy"}), ("from planner import identify", HEAVY)],
    ids=["planner", "identify"],
)
def test_the_import_loads_nothing_that_is_not_needed(line, unused):
    code = f"{line}; import sys; print(*sorted({unused} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
