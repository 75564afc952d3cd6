"""Candidates: every filter holds, the density is even, the funnel counts true, the empty case speaks."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from planner.cell.reading import load_cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.sequences import sobol_points
from planner.design.candidates.pool import Funnel, draw_candidates, explain_empty, explain_few
from planner.gauges.frame_gauge import sample_shell, shell_points
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import FIRST_MOUNTING
from planner.session.mount import MountMaps, drop_unreachable
from tests.shipped import cells_that


def cell_with(tmp_path, *changes):
    text = load_cell("comau-nj130/edbb").path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return load_cell(str(path))


@pytest.mark.slow
@pytest.mark.parametrize("name", cells_that(lambda cell: not cell.gauge.at_balls))
def test_every_candidate_passes_every_filter(name):
    """Checked by plain formulas and by python-fcl's kinematics-free cousin, not by the margins that drew them."""
    cell = load_cell(name).restrict_to(FIRST_MOUNTING)
    pool = draw_candidates(cell, 400)
    q = pool.q
    assert len(q) == 400
    assert ((q >= cell.robot.q_lower) & (q <= cell.robot.q_upper)).all()
    motion = cell.chain.forward(cell.robot.theta(q))
    bar = motion.x.T - cell.fixtures[0].p_BX
    length = np.linalg.norm(bar, axis=1)
    assert ((length > cell.gauge.length_min) & (length < cell.gauge.length_max)).all()
    up = np.degrees(np.arccos(bar @ cell.fixtures[0].axis_B / length))
    axis = np.einsum("ijn,j->ni", motion.R, cell.tool.axis_F)
    at_map = np.degrees(np.arccos(np.einsum("ni,ni->n", -bar, axis) / length))
    assert up.max() < np.degrees(cell.gauge.cone_fixture)
    assert at_map.max() < np.degrees(cell.gauge.cone_map)
    for axes, limit in cell.cable.sums:
        assert np.abs(q[:, axes] - cell.home[list(axes)]).sum(axis=1).max() <= limit
    world = CollisionWorld.from_cell(cell)
    assert world.distances(q).min() > cell.motion.clearance


def test_candidates_that_no_path_joins_are_told_where_too_few_are_left():
    cell = load_cell("comau-nj130/edbb")
    pool = draw_candidates(cell, 40)
    reach = MountMaps(np.arange(len(pool)) < 5, {})
    with pytest.raises(NoSolutionError, match=r"only 5 candidate poses .*; 35 of 40 candidates were left"):
        drop_unreachable(cell, pool, reach, "O2", None, 0)


def test_a_pair_that_always_stands_between_the_clearance_and_its_margin_is_named(monkeypatch):
    cell = load_cell("comau-nj130/edbb")

    def distances(world, q):
        near = np.full((len(q), len(world.scene.pairs)), 1.0)
        near[:, 3] = cell.motion.clearance + 1e-3
        return near

    monkeypatch.setattr(CollisionWorld, "distances", distances)
    said = explain_empty(cell, FIRST_MOUNTING, Funnel(9, 9, 9, 9, 9, 0))
    named = CollisionWorld.from_cell(cell, FIRST_MOUNTING).scene.describe_pair(3)
    assert re.search(rf"Every state collides \(nearer than .* mm\): {named} in 100% of the states; look", said)


@pytest.mark.slow
def test_two_bodies_that_are_always_too_near_end_the_search_early(monkeypatch):
    """The clearance is wider than what a pair of bodies leaves in any state: five thousand say so, not fifty."""
    cell = load_cell("kuka-kr6-r700/edbb")
    world, asked = CollisionWorld.from_cell(cell, FIRST_MOUNTING), list[int]()
    widest, collides = world.distances(draw_candidates(cell, 300).q).max(axis=0), CollisionWorld.collides
    wide = replace(cell, motion=replace(cell.motion, clearance=float(widest.min()) + 0.1))

    def counted(world, q, clearance=None):
        asked.append(len(q))
        return collides(world, q, clearance)

    monkeypatch.setattr(CollisionWorld, "collides", counted)
    with pytest.raises(NoSolutionError, match="in 100% of the states"):
        draw_candidates(wide, 1000)
    assert 5_000 < sum(asked) < 40_000


@pytest.mark.slow
def test_the_shell_sample_is_as_dense_as_blind_rejection():
    """Kolmogorov–Smirnov of every joint against blind uniform samples, and the count that the arcs stand for."""
    cell = load_cell("comau-nj130/edbb")
    sample = sample_shell(cell, FIRST_MOUNTING, shell_points(cell, 3)(1 << 15), cell.gauge.planned_range)
    lower, upper = cell.sampling_range
    blind = np.random.default_rng(5).uniform(lower, upper, (1_500_000, 6))
    length = np.linalg.norm(cell.map_position(blind) - cell.fixtures[0].p_BX, axis=1)
    shortest, longest = cell.gauge.planned_range
    inside = blind[(length > shortest) & (length < longest)]
    assert len(sample.q) / sample.stands_for == pytest.approx(len(inside) / len(blind), rel=0.05)
    for j in range(6):
        # the four points of an arc share the other joints: compare one of four
        assert stats.ks_2samp(sample.q[::4, j], inside[:, j]).pvalue > 1e-3, f"joint {j + 1}"


def test_the_funnel_never_grows_and_ends_with_the_pool():
    pool = draw_candidates(load_cell("comau-nj130/edbb"), 2000)
    f = pool.funnel
    assert f.sampled >= f.joint_limits > f.workspace > f.cones > f.cable >= f.collision >= len(pool) == 2000


def test_same_seed_same_candidates_other_seed_others():
    cell = load_cell("comau-nj130/edbb")
    a, b, c = (draw_candidates(cell, 500, seed=s).q for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


@pytest.mark.slow
def test_the_papers_joint_grid(tmp_path):
    cell = cell_with(tmp_path, ("[plan]", "[plan]\ngrid_step_deg = 25"))
    pool = draw_candidates(cell, 100_000)
    lower, upper = cell.sampling_range
    steps = (pool.q - (lower + upper) / 2) / np.deg2rad(25)
    assert np.allclose(steps * 2, np.round(steps * 2), atol=1e-9)  # whole or half steps from the middle
    assert 20 < len(pool) < pool.funnel.workspace < pool.funnel.joint_limits <= pool.funnel.sampled


def test_a_grid_too_fine_is_refused(tmp_path):
    with pytest.raises(InputError, match="grid_step_deg = 1"):
        draw_candidates(cell_with(tmp_path, ("[plan]", "[plan]\ngrid_step_deg = 1")), 100)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("position_mm = [258, 1468, 708]", "position_mm = [258, 4468, 708]"),
            ["out of reach", "move it by about", "0 in the gauge's range"],
        ),
        (("map_axis = [0, 0, 1]", "map_axis = [0, 0, -1]\nprior_mm = 2"), []),
        (
            ("cone_deg = { fixture = 80, map = 80 }", "cone_deg = { fixture = 5, map = 5 }"),
            ["0 within its cones", "gauge.cone_deg"],
        ),
        (("tool_about_bar_deg = 170", "tool_about_bar_deg = 1e-6"), ["0 within the cable", "cable"]),
        (("clearance_mm = 10", "clearance_mm = 900"), ["0 collision-free", "clearance_mm"]),
    ],
)
def test_an_empty_pool_says_which_filter_and_what_would_help(tmp_path, monkeypatch, change, words):
    monkeypatch.setattr("planner.design.candidates.pool.MOST_ROUNDS", 2)
    cell = cell_with(tmp_path, change)
    if not words:
        assert len(draw_candidates(cell, 50)) <= 50  # the other way round the tool is merely hard to reach
        return
    with pytest.raises(NoSolutionError) as err:
        draw_candidates(cell, 100)
    assert all(w in str(err.value) for w in words), str(err.value)


def test_successive_draws_are_one_sobol_sequence_and_no_warning_is_given(recwarn):
    draw = sobol_points(3, 7)
    drawn = np.vstack([draw(count) for count in (1, 40, 23)])
    assert np.array_equal(drawn, stats.qmc.Sobol(3, scramble=True, rng=np.random.default_rng(7)).random(64))
    assert not recwarn.list


def test_the_filter_that_leaves_few_candidates_is_named_with_what_helps():
    cell = load_cell("ur10/edbb")
    by_cones = explain_few(cell, Funnel(9000, 9000, 2000, 12, 11, 10))
    assert by_cones.startswith("12 of 2000 states in the gauge's range are within its cones")
    assert "gauge.cone_deg" in by_cones
    assert "motion.clearance_mm" in explain_few(cell, Funnel(9000, 9000, 2000, 1200, 1100, 10))
    assert "[cable]" in explain_few(cell, Funnel(9000, 9000, 2000, 1200, 20, 10))
    enough = cell.plan.candidates
    assert explain_few(cell, Funnel(*6 * [enough])) == "raise plan.candidates"  # as many as were asked for
    assert explain_few(cell, Funnel()) == "raise plan.candidates"
