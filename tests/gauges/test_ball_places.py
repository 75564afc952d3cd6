"""Balls of a plate that sit elsewhere than the cell says, and names of balls that were exchanged."""

import re

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.documents.calibrated_robot import calibrated_files
from planner.gauges.balls import check_exchanged_balls
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.identification.worlds import arm_of
from tests.simulation.generator import runs
from tests.simulation.generator.truth import Noise, Truth, draw_errors

NAME = "kuka-kr6-r700"
OFF = np.array([0.3, -2.0, 0.5])  # mm in the plate


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A run at the balls of a plate, of an arm with geometric errors alone."""
    arm = arm_of(NAME)
    truth = Truth(3, draw_errors(arm, np.random.default_rng(3)), (), Noise(5e-6, 1e-5), (1.0,) * 6)
    return runs.balls(arm, n_poses=80, seed=3, truth=truth, logs=()).write(tmp_path_factory.mktemp("balls"))


def _found(run, cell):
    return identify(load_runs([run], 6), load_cell(str(cell), planning=False), tracer=trace, settings=FitSettings())


def _balls(cell):
    return re.findall(r'\[\[balls\]\]\s*name = "([^"]+)"\s*position_mm = \[([^\]]+)\]', cell.read_text())


def _with_names_exchanged(run, one, two, out):
    lines = run.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    at = lines[first].split(",").index("ball")
    for k in range(first + 1, len(lines)):
        fields = lines[k].split(",")
        fields[at] = {one: two, two: one}.get(fields[at], fields[at])
        lines[k] = ",".join(fields)
    out.write_text("\n".join(lines) + "\n")
    return out


@pytest.mark.long
def test_a_ball_that_sits_elsewhere_is_found_and_the_robot_does_not_take_it(measured, tmp_path):
    run, cell = measured
    clean = _found(run, cell)
    assert not clean.findings
    names = [name for name, _ in _balls(cell)]
    assert len(names) >= 4  # of three, the run could not tell which
    name, place = _balls(cell)[1]
    wrong = tmp_path / "cell.toml"
    moved = np.array([float(v) for v in place.split(",")]) + OFF
    wrong.write_text(cell.read_text().replace(f"[{place}]", f"[{', '.join(map(str, moved))}]"))
    found = _found(run, wrong)
    assert [f.effect for f in found.findings] == ["ball place"]
    assert found.findings[0].on == f"ball {name}"
    # what the cell has too much is missing there
    sizes = {e.name: 1e3 * e.value for e in found.estimates if e.name.startswith(f"place_{name}")}
    np.testing.assert_allclose([sizes[f"place_{name}_{a}"] for a in "xyz"], -OFF, atol=0.1)
    assert found.workspace_error < 3 * clean.workspace_error
    assert "place_" not in dict(calibrated_files(found))["robot.toml"]


def test_exchanged_names_are_refused_and_named(measured, tmp_path):
    run, cell = measured
    first, second = [name for name, _ in _balls(cell)][:2]
    other = _with_names_exchanged(run, first, second, tmp_path / "run.csv")
    with pytest.raises(InputError, match=f"balls {first} and {second} look exchanged"):
        _found(other, cell)


@pytest.mark.slow
def test_of_all_pairs_the_one_that_fits_best_is_named(measured, tmp_path):
    """Another pair may fit better than none as well, since a plate can be turned."""
    run, cell = measured
    names = [name for name, _ in _balls(cell)]
    for a, b in ((1, 2), (2, 3), (1, 3)):
        with pytest.raises(InputError, match=f"balls {names[a]} and {names[b]} look exchanged"):
            _found(_with_names_exchanged(run, names[a], names[b], tmp_path / "run.csv"), cell)


def test_so_few_poses_that_any_names_fit_are_not_refused(measured):
    run = load_runs([measured[0]], 6)
    names = tuple(name for name, _ in _balls(measured[1]))
    with pytest.raises(InputError, match="look exchanged"):
        check_exchanged_balls(run, names, 1e-3, lambda _: 0.0)
    check_exchanged_balls(run.take(np.arange(3)), names, 1e-3, lambda _: 0.0)
