"""What is proven holds at every state that dense sampling finds; what is refused really fails."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.cell import Cell
from planner.cell.workspace import Workspace
from planner.common.units import Array, read_only
from planner.gauges.bar import LengthGauge
from planner.kinematics.bodies import Body
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld
from planner.motion.path.constraints import Constraints
from tests.motion.path.poses import cell_and_world, dense, valid_poses

STEPS = 1000


def holds(cell: Cell, world: CollisionWorld, q: Array, clearance: float) -> np.ndarray:
    """Whether states keep every constraint, by the modules that the proof does not use."""
    return np.asarray((Workspace(cell).margins(q) > 0.0).all(axis=1) & ~world.collides(q, clearance))


def motions(count: int) -> tuple[Array, Array]:
    """Half between near poses, half between any."""
    q = valid_poses(400)
    a = q[:count]
    apart = np.abs(a[:, None] - q[None]).max(axis=2)
    apart[np.arange(count), np.arange(count)] = np.inf
    near = q[np.argsort(apart, axis=1)[:, 1]]
    far = np.roll(q, 57, axis=0)[:count]
    return a, np.where(np.arange(count)[:, None] % 2 == 0, near, far)


@pytest.mark.slow
def test_proven_motions_hold_when_sampled_densely() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    a, b = motions(300)
    proof = constraints.prove(a, b)
    assert 0.3 < proof.proven.mean() < 0.9
    sampled = dense(a[proof.proven], b[proof.proven], STEPS)[::3]
    assert holds(cell, world, sampled, cell.motion.clearance).all()


@pytest.mark.slow
def test_extremes_are_those_of_dense_sampling() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    a, b = motions(60)
    found = constraints.extremes(np.stack([a, b], axis=1), 5e-4)
    sampled = dense(a, b, 400)
    length = np.linalg.norm(cell.map_position(sampled) - cell.fixtures[0].p_BX, axis=1)
    assert abs(found.length_min - length.min()) < 6e-4
    assert abs(found.length_max - length.max()) < 6e-4
    proven = constraints.prove(a, b).proven
    found = constraints.extremes(np.stack([a, b], axis=1)[proven], 5e-4)
    assert abs(found.clearance - world.distances(dense(a[proven], b[proven], 100)).min()) < 2e-3


@pytest.mark.long
def test_no_stop_of_a_printed_path_comes_nearer_than_is_stated() -> None:
    """Every single motion's clearance, held against another engine's distances at its ends, with rounded angles too."""
    cell, world = cell_and_world()
    constraints, other = Constraints(cell, scene=world.scene), FclWorld(world.scene)
    a, b = motions(60)
    proven = constraints.prove(a, b).proven
    rng, half = np.random.default_rng(3), np.deg2rad(5e-4)
    for start, end in zip(a[proven], b[proven], strict=True):
        stated = constraints.extremes(np.stack([start, end])[None], 5e-4).clearance
        path = np.vstack([start, end, dense(start[None], end[None], 50)])
        off = rng.choice([-half, half], (len(path), path.shape[1]))
        least = min(other.distances(path).min(), other.distances(path + off).min())
        assert least - 4e-4 < stated <= least + 2e-6


def test_refused_motions_fail_where_the_proof_says() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    a, b = motions(300)
    proof = constraints.prove(a, b)
    bad = ~proof.proven
    s = proof.failed_at[bad][:, None]
    at = (1 - s) * a[bad] + s * b[bad]
    assert not holds(cell, world, at, cell.motion.clearance + 1e-5).any()
    assert all(constraints.failure(proof, k) for k in np.flatnonzero(bad))
    assert all(constraints.failure(proof, k) is None for k in np.flatnonzero(~bad))
    again = constraints.prove(b, a)
    np.testing.assert_array_equal(again.proven, proof.proven)


def grazed_pin(cell: Cell, q: Array, dq: Array) -> Cell:
    """The cell with a pinhead that the rod of the bar just grazes when it passes q in the direction dq."""
    assert isinstance(cell.gauge, LengthGauge)
    x_X = cell.fixtures[0].p_BX
    x, ahead = cell.map_position(np.stack([q, q + 1e-6 * dq]))
    along = (x - x_X) / np.linalg.norm(x - x_X)
    aside = np.cross(along, ahead - x)
    T = np.eye(4)
    T[:3, 3] = x - 0.1 * along + (cell.gauge.rod_radius + 5e-4 + 9e-5) * aside / np.linalg.norm(aside)
    pin = Body("pinhead", "sphere", (5e-4,), read_only(T))
    return replace(cell, obstacles=(*cell.obstacles, pin), motion=replace(cell.motion, clearance=1e-4))


@pytest.mark.slow
def test_obstacles_between_any_samples_are_found() -> None:
    cell, world = cell_and_world()
    a, b = motions(300)
    good = np.flatnonzero(Constraints(cell, scene=world.scene).prove(a, b).proven)
    rng = np.random.default_rng(3)
    met, missed = 0, 0
    for k in good[np.abs(b[good] - a[good]).max(axis=1) > 0.5][:12]:
        s, step = rng.uniform(0.2, 0.8), b[k] - a[k]
        constraints = Constraints(grazed_pin(cell, a[k] + s * step, step))
        hit = constraints.world.find_near(a[k] + np.outer(np.linspace(s - 0.005, s + 0.005, 1001), step), 1e-4 - 1e-6)
        corners = np.stack([a[[k]], b[[k]]], axis=1)
        if hit.any():
            assert not constraints.prove_corners(corners).proven[0]
            assert not constraints.judge(corners).proven[0]
            met += 1
            missed += not constraints.world.find_near(dense(a[[k]], b[[k]], 100), 1e-4).any()
    assert met >= 8
    assert missed >= 4  # a hundred samples a motion would have let these pass


def test_motion_along_the_very_edge_is_refused_in_bounded_time() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    q = valid_poses(400)[:1].copy()
    q[:, 0] = cell.robot.q_upper[0]
    proof = constraints.prove(q, q + 0.0)
    assert not proof.proven[0]
    free = Constraints(cell, bar=False, scene=world.scene)
    edge = cell.home.copy()
    edge[3] = cell.robot.q_upper[3]
    turned = edge.copy()
    turned[0] += 1.0
    proof = free.prove(edge[None], turned[None])
    assert not proof.proven[0]
    assert "limit of joint 4" in str(free.failure(proof, 0))


@pytest.mark.slow
def test_proven_triangles_hold_inside() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    rng = np.random.default_rng(2)
    corner = valid_poses(400)[:200]
    entry, leave = (corner + rng.normal(scale=0.12, size=corner.shape) for _ in range(2))
    proof = constraints.prove_corners(np.stack([entry, corner, leave], axis=1))
    assert 0.1 < proof.proven.mean() < 0.95
    weights = rng.dirichlet([0.6, 0.6, 0.6], (200, 200))
    inside = np.einsum("nwk,kni->nwi", weights, np.stack([entry, corner, leave]))
    held = holds(cell, world, inside.reshape(-1, corner.shape[1]), cell.motion.clearance).reshape(200, 200)
    assert held[proof.proven].all()
    edges = [constraints.prove(x, y).proven for x, y in ((entry, corner), (corner, leave), (leave, entry))]
    assert np.all(edges, axis=0)[proof.proven].all()
    s = constraints.judge(np.stack([entry, corner, leave], axis=1))
    np.testing.assert_array_equal(s.proven, proof.proven)


def test_both_engines_prove_the_same_motions() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    a, b = motions(120)
    first, second = constraints.prove(a, b), constraints.judge(np.stack([a, b], axis=1))
    np.testing.assert_array_equal(first.proven, second.proven)
    nearest = FclWorld(constraints.scene).distances(a).min(axis=1)
    assert (second.clearance[first.proven] <= nearest[first.proven] + 0.2).all()


def test_reasons_name_the_constraint_and_the_number() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    q = valid_poses(400)[0]
    assert constraints.reason(q) is None
    assert constraints.valid(q[None])[0]
    far = q.copy()
    far[0] = cell.robot.q_upper[0] + np.deg2rad(4.0)
    assert not constraints.valid(far[None])[0]
    long = q + np.array([0.3, 0, 0, 0, 0, 0])
    assert "mm" in str(constraints.reason(long)) or "°" in str(constraints.reason(long))
    free = Constraints(cell, bar=False, scene=world.scene)
    low = cell.home.copy()
    low[1] = np.deg2rad(120.0)
    assert "mm wanted" in str(free.reason(low))
    assert not free.valid(low[None])[0]
