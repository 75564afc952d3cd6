"""A package outside the planner brings a command: it is typed, imported, asked for over HTTP and documented."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from tests.wings.installation import ROOT, edbb_in

MODULE = Path(__file__).with_name("reach.py")
ON_A_SERVER = """
from planner.service.job_requests import CommandRequest
from planner.common.calls import options_table
from planner.workflow.verbs import declared_calls
print(CommandRequest.model_validate({"words": ["reach", "ur10/edbb"]}).first_word)
print(options_table(declared_calls()["reach"]))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder as pip leaves it: the module, and the entry point that names it."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copy(MODULE, folder / "reach_of_mine.py")
    facts = folder / "reach-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: reach\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[edbb.extensions]\nreach = reach_of_mine\n")
    return folder, {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), str(ROOT))), "COLUMNS": "120"}


@pytest.mark.slow
def test_it_is_listed_and_its_help_has_its_options(installed):
    listed = edbb_in(*installed, "--help")
    assert "│ reach          Say how far the tool point comes from the base." in listed.stdout, listed.stderr
    shown = edbb_in(*installed, "reach", "--help").stdout
    assert "--states" in shown
    assert "random states that are tried" in shown


@pytest.mark.slow
def test_it_is_run(installed):
    folder, _ = installed
    done = edbb_in(*installed, "reach", "ur10/edbb", "-o", "out", "--states", 500, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told == json.loads((folder / "out" / "reach.json").read_text())
    cell = load_cell("ur10/edbb")
    q = np.random.default_rng(0).uniform(cell.robot.q_lower, cell.robot.q_upper, (500, cell.robot.n_joints))
    assert told["farthest_mm"] == pytest.approx(1e3 * np.linalg.norm(cell.map_position(q), axis=1).max())
    assert edbb_in(*installed, "reach", "ur10/edbb", "-o", "more", "--states", 0).returncode == 2
    assert edbb_in(*installed, "reach", "ur10/edb", "-o", "more").returncode == 2


def run_code(installed, code):
    folder, environment = installed
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_it_is_a_name_of_the_package(installed):
    code = "from planner import reach; import planner; print(reach('ur10/edbb', states=9), 'reach' in planner.__all__)"
    assert run_code(installed, code).strip().endswith("> True")


@pytest.mark.slow
def test_the_service_runs_it_and_the_documentation_has_its_table(installed):
    said = run_code(installed, ON_A_SERVER)
    assert said.startswith("reach\n")
    assert "| `--states` | 1 to 1e+06, default 10000 | random states that are tried |" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "instead", "said"),
    [
        (
            'verb = "reach"',
            'verb = "robots"',
            "command 'robots': an extension (reach_of_mine) brings it, and the planner has it already",
        ),
        (
            'verb = "reach"',
            'verb = "study"',
            "extension 'reach' (reach_of_mine): command 'study': another extension has registered it already",
        ),
        (
            'verb = "reach"',
            'verb = "reach"\n    group = "Uze"',
            "extension 'reach' (reach_of_mine): reach_of_mine: ReachCall: group = 'Uze' is no heading; did you mean "
            '"Use"? (allowed: Plan, Measure, Calibrate, Use, Keep, More)',
        ),
        ("import KW_ONLY, dataclass", "import KW_ONLY, datclass", None),
    ],
)
def test_what_cannot_be_used_is_told_and_stops_no_other_command(installed, tmp_path, line, instead, said):
    """The commands of the planner are listed and run; ``tests/common/test_extensions.py`` has those that stop."""
    folder, environment = installed
    shutil.copytree(folder, tmp_path / "site", ignore=shutil.ignore_patterns("out"))
    there = tmp_path / "site" / "reach_of_mine.py"
    there.write_text(there.read_text().replace(line, instead))
    environment = {**environment, "PYTHONPATH": os.pathsep.join((str(tmp_path / "site"), str(ROOT)))}
    done = edbb_in(tmp_path, environment, *(["robots", "--json"] if "robots" in instead else ["--help"]))
    assert done.returncode == 0
    assert "comau-nj130" in done.stdout or "List the robots and cells that come with" in done.stdout
    assert len(done.stderr.splitlines()) == 1
    if said is None:
        assert done.stderr.startswith("edbb: left out: extension 'reach' (reach_of_mine): ImportError: cannot import")
    else:
        assert done.stderr == f"edbb: left out: {said}\n"


def test_the_page_that_shows_it_includes_it():
    page = (ROOT / "docs" / "extend" / "command.md").read_text()
    assert "tests/wings/reach.py" in page
    assert importlib.util.spec_from_file_location("reach", MODULE)
