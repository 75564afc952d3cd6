"""The measurement model: its Jacobian by finite differences, and how many parameters each cell of the NJ-130 shows."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.model.model import Model
from planner.runs.run import Samples
from tests.shipped import cells_that


@pytest.mark.parametrize("name", cells_that(lambda cell: cell.gauge.is_attached))
def test_jacobian_agrees_with_finite_differences(name):
    cell = load_cell(name)
    model = Model.from_cell(cell, frozenset({"fixture", "tool", "zero"}))
    robot = cell.robot
    q = np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (30, robot.n_joints))
    at = Samples.at(q)
    J = model.rows(at)
    h = 1e-6
    for j, parameter in enumerate(model.names):
        step = np.zeros(len(model.names))
        step[j] = h
        moved = (model.reading(at, step) - model.reading(at, -step)) / (2 * h)
        np.testing.assert_allclose(J[:, :, j], moved, atol=1e-7, err_msg=parameter)


@pytest.mark.parametrize(
    ("cell_name", "free", "beta", "columns", "rank"),
    [
        ("paper", set(), False, 24, 22),
        ("edbb", set(), True, 25, 23),
        ("paper", {"fixture", "tool"}, False, 30, 23),
        ("edbb", {"fixture", "tool"}, True, 31, 24),
        ("edbb", {"fixture", "tool", "zero"}, True, 32, 25),
    ],
)
def test_what_the_bar_sees_of_the_nj130(cell_name, free, beta, columns, rank):
    """The published rank (EDBB paper: 22 of 24), and those with fixture, tool, zero and Hayati's parameter freed."""
    cell = load_cell(f"comau-nj130/{cell_name}")
    pool = draw_candidates(cell, 1500)
    model = Model.from_cell(cell, frozenset(free))
    assert len(model.names) == columns
    assert ("beta2" in model.names) == beta
    mu = np.linalg.svd(model.rows(pool.samples)[:, 0] * model.prior, compute_uv=False)
    assert mu[rank - 1] > 1e-3 * mu[0]
    assert mu[rank] < 1e-10 * mu[0]


def test_the_paper_drops_d3_and_the_last_angle_and_says_why():
    cell = load_cell("comau-nj130/paper")
    _, seen, rows = identify_candidates(cell, draw_candidates(cell, 1500))
    assert rows.shape[2] == seen.rank == 22
    reasons = {d.name: d.because for d in seen.dropped}
    assert set(reasons) == {"d3", "theta6"}
    assert "parallel" in reasons["d3"]
    assert "alpha6" in reasons["theta6"]


def test_two_fixtures_have_columns_of_their_own(tmp_path):
    text = load_cell("comau-nj130/edbb").path.read_text()
    path = tmp_path / "cell.toml"
    path.write_text(text + '\n[[fixtures]]\nname = "B"\nposition_mm = [1468, 258, 708]\n')
    cell = load_cell(str(path))
    model = Model.from_cell(cell)
    pool = draw_candidates(cell, 1000)
    J = model.rows(pool.samples)[:, 0]
    for f, name in enumerate("AB"):
        columns = [model.names.index(f"fixture_{name}_{a}") for a in "xyz"]
        assert not J[pool.samples.place != f][:, columns].any()
        np.testing.assert_allclose((J[pool.samples.place == f][:, columns] ** 2).sum(axis=1), 1.0)


@pytest.mark.slow
def test_noise_has_the_gauge_and_the_repeatability():
    cell = load_cell("comau-nj130/edbb")
    model = Model.from_cell(cell)
    at = draw_candidates(cell, 200).samples
    rng = np.random.default_rng(1)
    off = (rng.normal(scale=model.joint_sigma, size=at.q.shape) for _ in range(2000))
    shaken = np.array([model.reading(replace(at, q=at.q + d))[:, 0] for d in off])
    expected = np.sqrt(shaken.var(axis=0) + cell.gauge.noise**2)
    np.testing.assert_allclose(model.noise(at), expected, rtol=0.08)
