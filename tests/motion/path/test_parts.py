"""The map of connected parts grows with what is asked of it: nothing is proven twice, and what it joins is free."""

import numpy as np
import pytest

from planner.cell.workspace import Workspace
from planner.motion.path.connection import add_room, connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.parts import PartMap
from planner.motion.path.roadmap import Known
from planner.motion.path.verdict import ProvenPath
from tests.motion.path.poses import cell_and_world, dense, valid_poses


@pytest.fixture
def asked(monkeypatch):
    """Constraints of the paper's cell, and every motion that is proven under any constraints."""
    motions, prove = [], Constraints.prove
    monkeypatch.setattr(
        Constraints, "prove", lambda self, a, b: (motions.extend(zip(a, b, strict=True)), prove(self, a, b))[1]
    )
    cell, world = cell_and_world()
    return Constraints(cell, scene=world.scene), motions


def keys(motions):
    return [frozenset((a.tobytes(), b.tobytes())) for a, b in motions]


@pytest.mark.slow
def test_a_map_grows_by_poses_and_proves_no_motion_twice(asked):
    constraints, motions = asked
    q = valid_poses(700)[:160]
    first = PartMap.of(constraints, q[:80], 0)
    known = first.roadmap.graph.known.copy()
    grown = first.with_poses(q[40:])  # half of them are in it already
    assert len(grown.roadmap.graph.q) == 160
    assert len(set(keys(motions))) == len(motions)
    assert np.count_nonzero(grown.roadmap.graph.known == Known.PROVEN) >= np.count_nonzero(known == Known.PROVEN)
    joined = grown.joins_start(q)
    assert joined[0]
    assert joined[80:].any()


@pytest.mark.slow
def test_what_it_joins_is_joined_by_free_motions(asked):
    constraints, _ = asked
    q = valid_poses(700)[:120]
    grown = PartMap.of(constraints, q[:60], 0).with_poses(q[60:])
    graph = grown.roadmap.graph
    a, b = graph.edges[graph.known == Known.PROVEN].T
    cell, world = cell_and_world()
    states = dense(graph.q[a], graph.q[b], 30)
    assert not world.collides(states).any()
    assert (Workspace(cell).margins(states) > 0.0).all()
    part = grown.parts(graph.q)
    assert (part[a] == part[b]).all()
    ends = [set(np.concatenate([a[part[a] == k], b[part[a] == k]]).tolist()) for k in range(part.max() + 1)]
    assert all(len(e) == np.count_nonzero(part == k) or np.count_nonzero(part == k) == 1 for k, e in enumerate(ends))


@pytest.mark.slow
def test_another_start_proves_its_own_motions_alone(asked):
    constraints, motions = asked
    q = valid_poses(700)[:81]
    first = PartMap.of(constraints, q[:80], 0)
    motions.clear()
    cell, world = cell_and_world()
    other = first.begin_at(Constraints(cell, scene=world.scene), q[80])
    assert all(any((end == q[80]).all() for end in motion) for motion in motions)
    assert motions
    start = other.roadmap.graph.q[other.roadmap.place[0]]
    np.testing.assert_array_equal(start, q[80])
    assert other.joins_start(q[80:])[0]


@pytest.mark.slow
def test_ways_lead_over_a_map_and_what_it_has_proven_is_not_proven_again(asked):
    constraints, motions = asked
    q = valid_poses(700)[:200]
    known = PartMap.of(add_room(constraints, q[:1]), q, 0)
    stops = q[known.joins_start(q)][:8]
    before = set(keys(motions))
    motions.clear()
    found = connect_poses(constraints, stops, [*range(8), 0], pool=known.roadmap)
    assert isinstance(found, ProvenPath)
    assert found.clear
    assert any(not leg.direct for leg in found.legs)
    straight = set(keys((stops[a], stops[b]) for a in range(8) for b in range(8)))
    assert not (set(keys(motions)) - straight) & before


def test_states_of_the_map_that_a_path_joins_are_told_from_poses_beside_it(asked):
    constraints, _ = asked
    q = valid_poses(700)[:90]
    known = PartMap.of(constraints, q[:60], 0)
    assert not known.are_proven(q[60:]).any()
    np.testing.assert_array_equal(known.are_proven(q[:60]), known.joins_start(q[:60]))
    lost = known.find_unjoined_poses(q[60:], 1.0)
    np.testing.assert_array_equal(np.flatnonzero(~known.are_proven(q[60:])), lost)
    known.roadmap.with_poses(valid_poses(700)[90:95])  # a drive adds states that have no part yet
    np.testing.assert_array_equal(np.flatnonzero(~known.are_proven(q[60:])), lost)
