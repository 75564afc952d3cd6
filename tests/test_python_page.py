"""Every public name of the package stands in an example of the page on Python, and the examples run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import planner
from tests.identification.few_draws import few_draws
from tests.studies.conftest import shrink
from tests.workflow.conftest import FEWER, moving, small_cell

PAGE = Path(__file__).parents[1] / "docs" / "python.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
FROM_FILES, PLANNING, DESK = BLOCKS[1:]
ONE_LINE = 200  # letters of what a value shows of itself
__all__ = ["moving"]


def run_block(text, names):
    """Run an example; the names that it made, each shown in one short line."""
    exec(compile(text, str(PAGE), "exec"), names)
    for name in re.findall(r"^(\w+) = .*# (?:\w+)$", text, re.MULTILINE):
        shown = repr(names[name])
        assert "\n" not in shown, name
        assert len(shown) <= ONE_LINE, shown
    for name, kind in re.findall(r"^(\w+) = .*# (\w+)$", text, re.MULTILINE):
        assert type(names[name]) is getattr(planner, kind) or isinstance(names[name], getattr(planner, kind)), name
    return names


def test_every_public_name_stands_in_an_example():
    words = set(re.findall(r"\w+", FROM_FILES + PLANNING + DESK))
    assert {n for n in planner.__all__ if n != "__version__"} <= words


@pytest.mark.long
def test_the_examples_with_files_run(moving, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("session").symlink_to(moving.folder)
    Path("targets.csv").write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,10,-20,0,20,0\n")
    with few_draws():
        made = run_block(FROM_FILES, {})
    assert {"parameter", "value", "unit"} <= set(made["table"].columns)
    assert made["picture"].png.startswith(b"\x89PNG")
    assert "NJ-1" in made["history"].summary()
    for name in ("session.mod", "calibrated/robot.toml", "corrected.csv", "residuals.png"):
        assert Path(name).stat().st_size > 0


@pytest.mark.long
def test_the_examples_that_plan_run(moving, tmp_path, monkeypatch):
    """With few candidates, and circles of their own cell; the calibration is of a plan of the shared cell."""
    shrink(monkeypatch)
    cell = small_cell("comau-nj130/edbb", tmp_path, *FEWER)
    monkeypatch.chdir(tmp_path)
    text = PLANNING.replace('"comau-nj130/edbb", poses=60', f'r"{cell}", poses=28').replace(
        '"comau-nj130/edbb"', f'r"{cell}"'
    )
    names = {}
    with few_draws():
        exec(
            f"from planner import identify, simulate\nsimulate(r'{moving.folder}/plan.json').write('run.csv')\n"
            f"identify('run.csv', plan=r'{moving.folder}/plan.json', no_trace=True).write('calibrated')",
            names,
        )
        made = run_block(text, names)
    assert Path("check/plan.json").is_file()
    assert made["verdict"].verdict is not None


@pytest.mark.long
def test_the_examples_of_the_desk_run(moving, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("session").symlink_to(moving.folder)
    made = run_block(DESK, {})
    assert made["seen"].jacobian.shape[0] == 60
    assert made["chosen"].q.shape == (40, 6)
    assert made["noise"].comparisons["differs"].to_list()
    assert len(made["fits"]) == 3
    assert made["spread"] > 0


@pytest.mark.long
def test_a_type_checker_agrees_with_the_first_example(tmp_path):
    path = tmp_path / "first.py"
    path.write_text(BLOCKS[0])
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", path]
    found = subprocess.run(command, cwd=PAGE.parents[1], capture_output=True, text=True, check=False)
    assert "1 source file" in found.stdout, found.stderr
    assert f"{path.name}:" not in found.stdout, found.stdout
