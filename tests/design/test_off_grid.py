"""The bound off the grid of candidates, against poses that are moved there by the refinement and by descents anew."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.design import off_grid
from planner.design.candidates.pool import draw_candidates
from planner.design.off_grid import certify_off_grid, refine_poses
from planner.design.pose_selection import PoseChoice, identify_candidates
from planner.design.selection.index_search import exchange_poses
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import FIRST_MOUNTING

POSES = 30


@cache
def refined(index):
    cell = load_cell("comau-nj130/edbb")
    pool = draw_candidates(cell, 1200)
    model, seen, rows = identify_candidates(cell, pool)
    found = exchange_poses(rows, POSES, index, starts=1, steps=200)
    choice = PoseChoice.of_candidates(pool, found.chosen, model, seen, found.certificate)
    return cell, pool, refine_poses(cell, choice, 0)


@pytest.mark.slow
@pytest.mark.parametrize("index", [pytest.param("O1", marks=pytest.mark.long), "O2"])
def test_no_refined_set_beats_the_bound_off_the_grid(index):
    cell, pool, choice = refined(index)
    among, off = choice.certificate, certify_off_grid(cell, pool, choice)
    better = np.less if index == "O1" else np.greater  # O2, the condition number, is to be small
    assert better(choice.on_grid_value, choice.value)  # the poses left the candidates
    assert better(choice.value, off.value), "beyond what is said to be possible"
    assert better(among.value, off.value), "poses between the candidates allow more"
    assert off.candidates > among.candidates + POSES
    assert off.verified


def test_a_set_that_stayed_on_the_grid_keeps_the_bound_of_its_candidates():
    cell, pool, choice = refined("O2")
    stayed = replace(choice, q=choice.candidates.q)
    assert certify_off_grid(cell, pool, stayed) is choice.certificate


@pytest.mark.slow
def test_what_the_descents_find_are_poses(monkeypatch):
    """Each keeps the limits of joints, gauge and cable, and collides with nothing, as judged on its own."""
    cell, pool, choice = refined("O2")
    found = []
    descend = off_grid._descend_price
    monkeypatch.setattr(off_grid, "_descend_price", lambda *given: found.append(descend(*given)) or found[-1])
    monkeypatch.setattr(off_grid, "MOST_DESCENTS", 2)
    certify_off_grid(cell, pool, choice)
    q = np.concatenate([s.q for s in found])
    assert len(q) >= 400
    assert Workspace(cell, FIRST_MOUNTING).keeps_margin(q, 0.99 * SAFETY_MARGIN).all()
    assert not CollisionWorld.from_cell(cell, FIRST_MOUNTING).collides(q, cell.motion.clearance).any()
    assert np.abs(q[:, None] - pool.q[None]).max(axis=2).min(axis=1).max() > 0.05  # they went somewhere
