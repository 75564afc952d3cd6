"""One small study for the whole folder: fewer candidates and places than the real one, all else the same."""

import json

import pytest

import planner.studies.basis as basis
import planner.studies.basis as curves
import planner.studies.fixture_places as fixture_map
from planner.cell.reading import load_cell
from planner.studies.cell_study import study


def quiet(stage, done, of):
    pass


def shrink(patch):
    """Let a study look at fewer candidates, numbers of poses and places."""
    patch.setattr(basis, "CANDIDATES", 600)
    patch.setattr(curves, "GROWTH", (1.2, 1.6, 2.4))
    patch.setattr(curves, "ANNEALING_STEPS", 10)
    patch.setattr(fixture_map, "CANDIDATES", 300)
    patch.setattr(fixture_map.map_fixture_places, "__defaults__", (4, 3))


def small_study(folder, patch):
    shrink(patch)
    said = []
    result = study(load_cell("comau-nj130/edbb"), index="O1", seed=3, progress=lambda *step: said.append(step))
    result.write(folder)
    return result.findings, said


@pytest.fixture(scope="session")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        summary, said = small_study(folder, patch)
    return folder, summary, said


@pytest.fixture(scope="session")
def told(done):
    return json.loads((done[0] / "study.json").read_text())
