"""Every public name of the package stands in an example of the page on Python, and the examples run."""

import doctest
import inspect
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
NAMES = tuple(n for n in planner.__all__ if n != "__version__")
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
    assert set(NAMES) <= set(re.findall(r"\w+", FROM_FILES + PLANNING + DESK))


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


def example_of(name):
    """The example of a public name in its docstring, as code."""
    _, _, text = (inspect.getdoc(getattr(planner, name)) or "").partition("Example:")
    return "\n".join(e.source.rstrip() for e in doctest.DocTestParser().get_examples(text))


def test_every_public_name_has_an_example_in_its_docstring():
    examples = {name: example_of(name) for name in NAMES}
    assert [name for name, text in examples.items() if not text] == []
    for name, text in examples.items():
        kind = getattr(planner, name)
        assert isinstance(kind, type) or re.search(rf"\b{name}\(", text), name


@pytest.mark.long
def test_a_type_checker_agrees_with_every_example(tmp_path):
    """Those of the page and those of the docstrings, which name what they start from."""
    known = f"import numpy as np\nfrom planner import {', '.join(NAMES)}\n"
    given = "q: np.ndarray[tuple[int, int], np.dtype[np.float64]]\n"
    given += "found: CalibrationResult\nsession: PlanResult\nruns: list[Run]\nframe: object\n"
    texts = {f"page{k}": text for k, text in enumerate(BLOCKS)}
    texts |= {f"doc_{name}": known + given + example_of(name) for name in NAMES}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", *tmp_path.glob("*.py")]
    found = subprocess.run(command, cwd=PAGE.parents[1], capture_output=True, text=True, check=False)
    assert f"{len(texts)} source files" in found.stdout, found.stderr
    assert [line for line in found.stdout.splitlines() if line.startswith(str(tmp_path))] == []
