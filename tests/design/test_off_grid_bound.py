"""The bound off the grid of candidates, against poses that are moved there by the refinement and by descents anew."""

from functools import cache

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.design.candidates.pool import draw_candidates
from planner.design.observability.information import all_indices
from planner.design.off_grid_bound import certify_off_grid
from planner.design.pose_selection import PoseChoice, identify_candidates, refine_poses
from planner.design.selection.index_search import exchange_poses
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import FIRST_MOUNTING

POSES = 30


@cache
def refined(index):
    cell = load_cell("comau-nj130/edbb")
    pool = draw_candidates(cell, 3000)
    model, seen, rows = identify_candidates(cell, pool)
    found = exchange_poses(rows, POSES, index, starts=1, steps=200)
    samples = pool.samples.take(found.chosen)
    final = model.rows(samples)
    both = all_indices(final), all_indices(final, model.prior)
    choice = PoseChoice(
        model, seen, samples, found.chosen, index, found.value, found.value, found.certificate, *both, None
    )
    return cell, pool, refine_poses(cell, choice, 0)


@pytest.mark.parametrize("index", ["O1", "O2"])
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
    stayed = choice.__class__(**{**vars(choice), "value": choice.on_grid_value})
    assert certify_off_grid(cell, pool, stayed) is choice.certificate


def test_what_the_descents_find_are_poses(monkeypatch):
    """Each keeps the limits of joints, gauge and cable, and collides with nothing, as judged on its own."""
    import planner.design.off_grid_bound as module

    cell, pool, choice = refined("O2")
    found = []
    lowest = module._Descent.lowest
    monkeypatch.setattr(module._Descent, "lowest", lambda self, seed: found.append(lowest(self, seed)) or found[-1])
    monkeypatch.setattr(module, "ROUNDS", 2)
    certify_off_grid(cell, pool, choice)
    q = np.concatenate([s.q for s in found])
    assert len(q) >= 400
    assert Workspace(cell, FIRST_MOUNTING).inside(q, 0.99 * SAFETY_MARGIN).all()
    assert not CollisionWorld.from_cell(cell, FIRST_MOUNTING).collides(q, cell.motion.clearance).any()
    assert np.abs(q[:, None] - pool.q[None]).max(axis=2).min(axis=1).max() > 0.05  # they went somewhere
