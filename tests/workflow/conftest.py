"""Two small plans, made once by the command line as a user would: one measured while moving, one at rest."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from planner.cell.reading import load_cell
from tests.command import edbb
from tests.not_everywhere import require_planning
from tests.quick_search import quick_search


def small_cell(name, folder, *changes):
    """A shipped cell with few candidates and other changes, as a file."""
    text = load_cell(name).path.read_text()
    if "[plan]" not in text:
        text += "\n[plan]\n"
    for old, new in (("[plan]", "[plan]\ncandidates = 3000\nvalidate = 4"), *changes):
        assert old in text, old
        text = text.replace(old, new, 1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "edbb.toml"
    path.write_text(text)
    return path


FEWER = (("candidates = 3000", "candidates = 300"),)
POSES = 28


@dataclass(frozen=True)
class Planned:
    cell_path: Path
    folder: Path
    plan: dict
    stdout: str
    stderr: str


def planned(name, folder, poses, *dialects, changes=()):
    require_planning()
    path = small_cell(name, folder, *changes)
    words = [w for d in dialects for w in ("--dialect", d)]
    with quick_search():
        done = edbb("plan", path, "-o", folder / "out", "--poses", poses, "--json", *words)
    assert done.returncode == 0, done.stderr
    plan = json.loads((folder / "out" / "plan.json").read_text())
    return Planned(path, folder / "out", plan, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def moving(tmp_path_factory):
    return planned("comau-nj130/edbb", tmp_path_factory.mktemp("nj"), POSES, "bnr", "krl", changes=FEWER)


@pytest.fixture(scope="session")
def resting(tmp_path_factory):
    return planned("kuka-kr6-r700/edbb", tmp_path_factory.mktemp("kr6"), POSES, "krl", "sinumerik", changes=FEWER)


@pytest.fixture(params=["moving", pytest.param("resting", marks=pytest.mark.long)])
def either(request):
    return request.getfixturevalue(request.param)
