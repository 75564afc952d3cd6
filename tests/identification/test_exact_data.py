"""Readings without any noise, rounded or not, give a calibration and say what was assumed of the noise."""

from dataclasses import replace

import numpy as np
import pytest

from planner.fit.noise import Noise, Whitener, estimate_noise, least_noise
from planner.identification.pipeline import FitSettings, identify
from planner.release.error_history import error_history
from tests.identification.few_draws import few_draws
from tests.identification.worlds import loaded
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.runs import balls, edbb_static, tracker
from tests.simulation.generator.truth import Noise as TrueNoise
from tests.simulation.generator.truth import Truth, draw_errors

NAME = "kuka-kr6-r700"
MAKE = {"tracker": tracker, "edbb": edbb_static, "balls": balls}
SILENT = TrueNoise(gauge=0.0, joint=0.0)
AS_IF_NO_NOISE = "the readings fit as if they had no noise"


def exact(kind, errors=True, poses=50):
    """A run without noise, its cell with a usual noise, and the errors of the arm."""
    arm = Arm.from_toml(NAME)
    truth = Truth(3, draw_errors(arm, np.random.default_rng(3)) if errors else {}, (), SILENT)
    made = MAKE[kind](arm, poses, 3, truth)
    stated = made.cell_toml.replace("noise_um = 0\n", "noise_um = 5\n").replace("noise_um = 0.0\n", "noise_um = 5\n")
    return loaded(replace(made, cell_toml=stated))


def rounded(run, unit):
    """The same, its readings rounded to whole units [m]."""
    of = run.readings
    values = {n: np.round(v / unit) * unit for n in ("length", "position") if (v := getattr(of, n, None)) is not None}
    return replace(run, readings=replace(of, **values))


@pytest.mark.parametrize("residual", [0.0, 1e-16, 1e-9])
@pytest.mark.parametrize("rows", [10, 200])
@pytest.mark.parametrize("width", [1, 3, 6])
def test_the_noise_of_residuals_that_are_next_to_nothing_is_a_part_of_what_is_declared(residual, rows, width):
    white = Whitener(np.full((rows, width), 1e-10), 1e-12 * np.tile(np.eye(width), (rows, 1, 1)), Noise())
    noise = estimate_noise(white, np.full((rows, width), residual), np.zeros((rows, width)))
    assert noise == Noise(least_noise(), least_noise(), least_noise())


@pytest.mark.slow
@few_draws()
@pytest.mark.parametrize("unit", [pytest.param(0.0, marks=pytest.mark.long), 1e-7])
def test_exact_readings_of_a_tracker_give_the_robot(unit):
    run, cell = exact("tracker")
    found = identify(rounded(run, unit) if unit else run, cell)
    assert found.problems == ()
    assert any(text.startswith(AS_IF_NO_NOISE) for text in found.warnings)
    assert 0 < found.workspace_error < 2e-5
    history = error_history(found.released, found.run.samples)
    assert np.isfinite(history.error).all()
    assert np.isfinite(history.worth).all()
    assert history.error[-1] == pytest.approx(found.workspace_error)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAKE)
def test_exact_readings_of_the_nominal_robot_leave_it_as_it_is(kind):
    run, cell = exact(kind, errors=False)
    found = identify(run, cell, settings=FitSettings(release=False))
    assert found.problems == ()
    lengths = [e for e in found.estimates if e.group == "geometry" and e.unit == "m"]
    assert lengths
    assert max(abs(e.value - e.nominal) for e in lengths) < 1e-6
