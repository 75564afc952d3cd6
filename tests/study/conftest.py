"""One small study for the whole folder: fewer candidates and places than the real one, all else the same."""

import json

import pytest

from planner.cell import load_cell
from planner.study import basis, curves, fixture_map, study


def quiet(stage, done, of):
    pass


def small_study(folder, patch):
    patch.setattr(basis, "CANDIDATES", 600)
    patch.setattr(curves, "GROWTH", (1.2, 1.6, 2.4))
    patch.setattr(curves, "STEPS", 10)
    patch.setattr(fixture_map, "CANDIDATES", 300)
    patch.setattr(fixture_map.fixture_map, "__defaults__", (4, 3))
    said = []
    summary = study(load_cell("comau-nj130/edbb"), folder, "O1", 3, lambda *step: said.append(step))
    return summary, said


@pytest.fixture(scope="session")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        summary, said = small_study(folder, patch)
    return folder, summary, said


@pytest.fixture(scope="session")
def told(done):
    return json.loads((done[0] / "study.json").read_text())
