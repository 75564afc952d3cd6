"""A tracker's own scale: no pose shows it, its cell says how well it is known, and nests show when it is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from planner.accuracy.tracker_nests import compare_nest_distances
from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.inference.posterior_background import background_families
from planner.runs.run import ReferenceReadings, Samples

NESTS_MM = np.array([[0.0, -300.0, 0.0], [0.0, 300.0, 0.0], [300.0, 120.0, 0.0]])  # as the shipped cell has them
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def cell_with(tmp_path, key, name="kuka-kr6-r700/tracker"):
    """Return a shipped cell with one more key of [gauge]."""
    path = tmp_path / "cell.toml"
    path.write_text(load_cell(name).path.read_text().replace("[gauge]\n", f"[gauge]\n{key}\n", 1))
    return load_cell(path)


def read_nests(scale):
    """What a tracker reads whose lengths are ``scale`` times the true ones, standing anywhere."""
    seen = scale * (NESTS_MM @ TURN.T + [2100.0, 40.0, -300.0]) / 1e3
    return ReferenceReadings(tuple((f"N{k}", p) for k, p in enumerate(seen, start=1)))


@pytest.mark.parametrize(("key", "sigma"), [("", 2e-6), ("scale_ppm = 50", 5e-5)])
def test_what_the_cell_says_of_the_scale_is_the_size_that_the_posterior_counts_with(key, sigma, tmp_path):
    setup = setup_of(cell_with(tmp_path, key))
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 6))
    families = {f.name: f for f in background_families(setup, Samples(q, np.zeros(40, int)))}
    assert families["gauge scale"].known
    assert [p.prior for p in families["gauge scale"].parameters] == [pytest.approx(sigma)]


def test_a_plan_writes_the_key_only_where_it_is_set(tmp_path):
    assert "scale_ppm" not in load_cell("kuka-kr6-r700/tracker").file.gauge.model_dump()
    assert cell_with(tmp_path, "scale_ppm = 50").file.gauge.model_dump()["scale_ppm"] == 50


def test_a_camera_is_told_which_key_is_its_own(tmp_path):
    with pytest.raises(InputError, match=r"'gauge.scale_ppm': a camera's scale is .*'gauge.board.scale_ppm'"):
        cell_with(tmp_path, "scale_ppm = 50", "ur5e/camera")


@pytest.mark.parametrize(("scale", "words"), [(1.001, "0.1 % longer"), (0.9995, "0.05 % shorter")])
def test_nests_show_a_scale_that_no_pose_shows(scale, words):
    said = compare_nest_distances(load_cell("kuka-kr6-r700/tracker"), read_nests(scale))
    assert words in said
    assert f"N1 to N2: {600 * scale:.3f} mm, position_mm says 600.000" in said


def test_nests_that_were_read_well_or_not_at_all_say_nothing():
    cell = load_cell("kuka-kr6-r700/tracker")
    said = read_nests(1.00002)
    assert compare_nest_distances(cell, said) == ""
    assert compare_nest_distances(cell, ReferenceReadings()) == ""
    assert compare_nest_distances(cell, replace(said, nests=said.nests[:1])) == ""
