"""Positions in another unit than their columns say are refused; points that truly hardly move are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.runs.run import Readings, Run, Samples
from planner.workflow.run_checks import check_unit
from tests.command import edbb

CELL = 'schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\nkind = "tracker"\n'
TOOL = np.array([0.05, 0.02, 0.25])  # [m] in the flange


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(CELL)
    return load_cell(str(path), planning=False)


def points(cell, q):
    """Where the tool point stands, (n, 3) [m], by the joints' own rotations one after the other."""
    motion = cell.robot.chain.forward(cell.robot.theta(q))
    return motion.x.T + np.einsum("ijn,j->ni", motion.R, TOOL)


def run_of(cell, q, factor=1.0, noise=5e-4, place=None):
    """A run that a tracker somewhere in the room reads, a robot half a millimetre off."""
    rng = np.random.default_rng(3)
    turned = Rotation.random(rng=rng).apply(points(cell, q)) + rng.normal(size=3)
    p_GM = (turned + noise * rng.normal(size=(len(q), 3))) * factor
    place = np.zeros(len(q), dtype=int) if place is None else place
    return Run("points", Samples(q, place), Readings(position=p_GM), places=tuple(map(str, range(place.max() + 1))))


def poses(n, reach):
    rng = np.random.default_rng(5)
    return np.deg2rad([0.0, -60.0, 80.0, -40.0, 60.0, 10.0]) + reach * rng.uniform(-1, 1, (n, 6))


@pytest.mark.parametrize("n", [9, 400])
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1e-3, "look like metres in x_mm, or millimetres in x_um; if so, call them x_m, y_m, z_m"),
        (1e3, "look like millimetres in x_m, or micrometres in x_mm; if so, call them x_mm, y_mm, z_mm"),
        (1e-6, "look like metres in x_um; if so, call them x_m, y_m, z_m"),
        (0.1, "look like centimetres; if so, give 10 times the numbers"),
        (1 / 25.4, "look like inches; if so, give 25.4 times the numbers"),
    ],
)
def test_a_thousandfold_is_refused(cell, n, factor, words):
    with pytest.raises(InputError, match=words) as caught:
        check_unit(run_of(cell, poses(n, 0.7), factor), cell)
    assert str(caught.value).startswith("points: the points lie ")


def test_two_stations_are_looked_at_one_by_one(cell):
    q, place = poses(60, 0.7), np.arange(60) % 2
    there = run_of(cell, q, place=place)
    far = np.asarray(there.readings.position) + 9.0 * place[:, None]
    check_unit(replace(there, readings=Readings(position=far)), cell)
    small = replace(there, readings=Readings(position=far / 1e3))
    with pytest.raises(InputError, match="look like metres"):
        check_unit(small, cell)


@pytest.mark.parametrize("reach", [0.7, 0.05, 0.001, 0.0])
def test_runs_of_every_size_pass(cell, reach):
    check_unit(run_of(cell, poses(40, reach)), cell)


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise", [pytest.param(5e-5, marks=pytest.mark.long), 2e-4, pytest.param(1e-3, marks=pytest.mark.long)]
)
def test_an_arm_that_turns_about_its_point_passes(cell, noise):
    """The flange moves by a hundred millimetres or more, the point by less than one: that is no other unit."""
    at = points(cell, poses(1, 0.0))[0]
    q = np.array([least_squares(lambda v: points(cell, v[None])[0] - at, start).x for start in poses(25, 0.4)])
    turning = run_of(cell, q, noise=noise)
    spread = np.std(cell.robot.chain.forward(cell.robot.theta(q)).x)
    assert np.std(turning.readings.position, axis=0).max() < 0.05 * spread
    check_unit(turning, cell)


@pytest.mark.slow
def test_the_command_refuses_before_it_fits(cell, tmp_path):
    q = poses(30, 0.7)
    p = np.asarray(run_of(cell, q).readings.position)
    head = ",".join([f"q{j}_deg" for j in range(1, 7)] + ["x_mm", "y_mm", "z_mm"])
    np.savetxt(tmp_path / "run.csv", np.hstack([np.rad2deg(q), p]), delimiter=",", header=head, comments="")
    done = edbb("identify", tmp_path / "run.csv", "--cell", cell.path, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "run: the points lie" in done.screen
    assert not (tmp_path / "out").exists()
