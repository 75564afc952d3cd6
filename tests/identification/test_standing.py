"""Errors of the base count from where the cell has the artifact; an artifact found far away is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.identification.pipeline import FitSettings, identify
from tests.identification.few_draws import few_draws
from tests.identification.test_declared import cell, made


def moved(by_mm):
    """The cell with its artifact elsewhere than it stands."""
    there = cell()
    artifact = there.file.artifact
    position = tuple(float(v) for v in np.add(artifact.position_mm, by_mm))
    file = there.file.model_copy(update={"artifact": artifact.model_copy(update={"position_mm": position})})
    return replace(there, file=file)


def base_mm(found):
    told = {e.name: e.value for e in found.last_fit}
    return 1e3 * np.array([told[f"base_{axis}"] for axis in "xyz"])


def error_of(found, name):
    fit = (found.released or found).fit
    return float(fit.errors[fit.model.names.index(name)])


@pytest.mark.slow
@few_draws()
@pytest.mark.parametrize("release", [False, pytest.param(True, marks=pytest.mark.long)])
def test_the_bases_errors_count_from_the_cells_place(release):
    """Another place in the cell is another error of the base, by as much; where the artifact is found stays."""
    run, _ = made(2, soft=1e-4)
    by_mm = np.array([1.5, -2.0, 0.7])
    here, there = (identify(run, c, settings=FitSettings(release=release)) for c in (cell(), moved(by_mm)))
    assert np.allclose(base_mm(there) - base_mm(here), by_mm, atol=1e-4)
    place, again = (found.frames.places[0] for found in (here, there))
    assert np.allclose(place.position, again.position, atol=1e-8)
    assert np.allclose(place.rpy, again.rpy, atol=1e-8)
    turn = Rotation.from_euler("XYZ", [error_of(here, f"base_r{x}") for x in "xyz"])
    shift = 1e3 * np.array([error_of(here, f"base_{x}") for x in "xyz"])
    wanted = turn.inv().apply(np.array(cell().file.artifact.position_mm) - shift)
    assert np.allclose(1e3 * np.array(place.position), wanted, atol=1e-4)
    assert not any("from where [artifact]" in w for w in (*here.warnings, *there.warnings))


@pytest.mark.slow
def test_an_artifact_found_elsewhere_is_told():
    run, _ = made(2, soft=1e-4)
    found = identify(run, moved((0, 100, 0)), settings=FitSettings(release=False))
    (said,) = [w for w in found.warnings if w.startswith("the run puts the balls ")]
    assert 95 < float(said.split()[5]) < 105


def test_distances_from_the_centre_beyond_the_indicators_are_refused():
    run, _ = made(2, soft=1e-4)
    offset = np.zeros((len(run), 3))
    offset[4, 0] = 2.5
    with pytest.raises(InputError, match="2500 mm off centre, but the indicators"):
        identify(replace(run, readings=replace(run.readings, offset=offset)), cell())
