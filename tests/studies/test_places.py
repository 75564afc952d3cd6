"""The map of fixture places and the count of fixtures, against selections and ranks found another way."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.cell.workspace import Workspace
from planner.common.units import read_only
from planner.design.candidates.pool import draw_candidates
from planner.design.fixtures.places import find_stands, is_blocked, move_fixture, reach_poses
from planner.design.selection.index_search import improve_poses
from planner.design.selection.pruning import prune_poses
from planner.kinematics.bodies import capsule_between
from planner.model.model import Model
from planner.runs.run import Mounting, Samples
from planner.studies.fixture_count import combine_places, count_fixtures
from planner.studies.fixture_places import map_fixture_places


@pytest.fixture(scope="module")
def cell():
    return load_cell("comau-nj130/edbb")


@pytest.mark.slow
def test_a_stand_comes_along_and_keeps_its_foot(cell):
    assert [cell.obstacles[k].name for k in find_stands(cell)] == ["fixture stand"]
    place = np.array([0.5, -1.0, 1.1])
    stand = move_fixture(cell, place).obstacles[0]
    half = np.array([0, 0, stand.size[1] / 2])
    assert np.allclose(stand.T[:3, 3] - half, [0.5, -1.0, 0.06])
    assert np.allclose(stand.T[:3, 3] + half, place - [0, 0, 0.078])


@pytest.mark.slow
def test_other_obstacles_stay(cell):
    wall = capsule_between("wall", np.array([1.0, 1.0, 0.0]), np.array([1.0, 1.0, 2.0]), 0.05)
    beside = move_fixture(replace(cell, obstacles=(*cell.obstacles, wall)), np.array([0.5, -1.0, 1.1])).obstacles[1]
    assert np.array_equal(beside.T, wall.T)
    assert beside.size == wall.size


@pytest.mark.slow
def test_poses_of_a_place_keep_every_filter(cell):
    place = np.array([0.6, 0.9, 1.2])
    there, found = move_fixture(cell, place), reach_poses(cell, place, 200, 1)
    assert len(found.q) == 200
    assert (Workspace(there).margins(found.q) > 0).all()
    assert np.all(np.linalg.norm(there.map_position(found.q) - [0.6, 0.9, 1.2], axis=1) >= 0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "status"), [([0.0, 0.0, 0.7], "blocked"), ([4.0, 0.0, 1.0], "unreachable"), ([1.2, 0.0, -0.9], "blocked")]
)
def test_places_that_cannot_be_used_say_why(cell, place, status):
    base = replace(cell.base, floor=0.0 if place[2] < 0 else cell.base.floor)
    found = reach_poses(replace(cell, base=base), np.array(place), 100, 0)
    assert found.status == status
    assert len(found.q) == 0


@pytest.mark.slow
def test_a_robot_close_to_the_floor_blocks_no_place():
    """The first link of this robot is always nearer to the floor than the clearance: that is no stand in its way."""
    cell = load_cell("ur10/edbb")
    for step in ([0.0, 0.0, 0.0], [0.0, 0.05, 0.0]):
        assert len(reach_poses(cell, cell.fixtures[0].p_BX + np.array(step), 50, 0).q) == 50


@pytest.mark.slow
def test_a_stand_may_touch_what_it_stands_on_and_nothing_else(cell):
    table = capsule_between("table", np.array([0.258, 1.3, 0.0]), np.array([0.258, 1.6, 0.0]), 0.05)
    post = capsule_between("post", np.array([0.9, 0.9, 0.0]), np.array([0.9, 0.9, 0.6]), 0.05)
    present = replace(cell, obstacles=(*cell.obstacles, table, post))
    assert not is_blocked(move_fixture(present, np.array([0.258, 1.4, 0.708])), present)
    assert is_blocked(move_fixture(present, np.array([0.9, 0.95, 0.708])), present)


@pytest.mark.slow
def test_present_value_is_that_of_the_selection_on_the_same_candidates(done, cell):
    """Draw the place's candidates again, prune and exchange; the index is that of numpy's singular values."""
    m = done[1].places
    q = reach_poses(cell, cell.fixtures[0].p_BX, 300, 3).q
    rows = Model.from_cell(cell).rows(Samples.at(q))[:, :, list(m.kept)]
    chosen = improve_poses(rows, prune_poses(rows, m.poses, "O1", 200), "O1")
    mu = np.linalg.svd(rows[chosen, 0], compute_uv=False)
    assert m.present.value == pytest.approx(np.exp(np.log(mu).mean()) / np.sqrt(m.poses), rel=1e-9)
    assert m.kept == done[1].basis.seen.kept
    pruned = np.linalg.svd(rows[prune_poses(rows, m.poses, "O1", 200), 0], compute_uv=False)
    assert np.log(mu).sum() >= np.log(pruned).sum()
    assert m.best_place.value == max(p.value for p in m.usable_places)


@pytest.mark.slow
def test_fixture_sets_have_the_rank_of_plain_stacked_rows(done, cell):
    """Rank of every pair and triple tried, from a cell that has those fixtures, by one SVD of all its rows."""
    m, steps = done[1].places, done[1].fixtures.steps
    for step in steps:
        points = [s.place for s in steps[: step.fixtures]]
        stock = cell.fixtures[0]
        many = replace(
            cell, fixtures=tuple(replace(stock, name=f"F{k}", p_BX=read_only(p)) for k, p in enumerate(points))
        )
        model = Model.from_cell(many)
        rows = np.vstack(
            [model.rows(Samples.at(reach_poses(cell, p, 300, 3).q, Mounting(k)))[:, 0] for k, p in enumerate(points)]
        )
        mu = np.linalg.svd(rows * model.prior, compute_uv=False)
        assert step.parameters == len(model.names)
        assert step.seen == int((mu > 1e-9 * mu[0]).sum())
        placed = [next(p for p in m.places if p.information is not None and np.array_equal(p.p_BX, x)) for x in points]
        combined = combine_places(m, placed, 1e-5)
        share = np.linalg.svd(combined.rows[:, 0] * combined.prior, compute_uv=False) / np.sqrt(len(combined.rows))
        ours = np.linalg.svd(rows * model.prior, compute_uv=False) / np.sqrt(len(rows))
        assert np.allclose(share[: step.seen], ours[: step.seen], rtol=1e-6)


@pytest.mark.slow
def test_remedies_are_what_plain_ranks_say(done, cell):
    """A parameter is visible when its column is outside the span of the others."""
    f = done[1].fixtures
    q = reach_poses(cell, cell.fixtures[0].p_BX, 300, 3).q
    unseen = [d.name for d in f.steps[0].dropped]
    for says, free in (
        ("the fixture's place measured", {"tool", "zero"}),
        ("the tool point measured", {"fixture", "zero"}),
        ("the tool point and the place of the fixture measured", {"zero"}),
    ):
        model = Model.from_cell(cell, frozenset(free))
        tall = model.rows(Samples.at(q))[:, 0] * model.prior
        _, mu, axes = np.linalg.svd(tall)
        null = axes[mu <= 1e-9 * mu[0]]
        part = np.abs(null).max(axis=0, initial=0.0)
        free_names = {n for n, share in zip(model.names, part, strict=True) if share < 1e-6}
        shown = set(next(r for r in f.remedies if r.name == says).shows)
        assert len(unseen) - len(shown) == len(null)
        assert free_names & set(unseen) <= shown
    assert [d.name for d in f.lost_parameters] == ["d3"]
    assert f.fewest_fixtures == 1


@pytest.mark.slow
def test_a_base_that_may_turn_about_one_known_fixture_is_held_by_two():
    """This robot's first row can tilt its base: seen with two known points, not with one; a third shows no more."""
    cell = load_cell("kuka-kr6-r700/edbb")
    at = cell.fixtures[0].p_BX
    points = [at, np.array([0.5, -0.3, at[2]]), np.array([0.4, 0.2, at[2] + 0.4])]
    m = map_fixture_places(cell, draw_candidates(cell, 300), "O1", 40, 0, lambda *step: None, across=3, up=2)
    f = count_fixtures(cell, m, 1e-5, 0)
    model = Model.from_cell(cell, frozenset({"tool", "zero"}))
    parts = []
    for p in points:
        there = Model.from_cell(move_fixture(cell, p), frozenset({"tool", "zero"}))
        parts.append(there.rows(Samples.at(reach_poses(cell, p, 200, 0).q))[:, 0] * model.prior)
    sets = [np.vstack(parts[: k + 1]) for k in range(3)]
    ranks = [int((np.linalg.svd(t, compute_uv=False) > 1e-8).sum()) for t in sets]
    assert ranks[2] == ranks[1] > ranks[0]
    remedies = {r.name: r for r in f.remedies}
    assert len(model.names) - len(remedies["the fixture's place measured"].dropped) == ranks[0]
    assert len(model.names) - len(remedies["the places of 2 fixtures measured"].dropped) == ranks[1]
    assert "d1" not in {d.name for d in f.lost_parameters}
