"""The bounds hold for every point of a neighbourhood, and are not empty talk."""

import numpy as np
import pytest

from planner.cell.workspace import Workspace
from planner.common.units import Array
from planner.motion.path.margins import PairBounds, WorkspaceBounds
from tests.motion.path.poses import cell_and_world, valid_poses

CELLS = ["comau-nj130/edbb", "kuka-kr6-r700/edbb", "ur10/edbb"]


def neighbourhoods(name: str, size: float, corners: int, n: int = 150) -> tuple[Array, Array, Array]:
    """Centres, spokes, and three random points inside each neighbourhood."""
    q = valid_poses(150, name)[:n]
    rng = np.random.default_rng(corners)
    spokes = rng.normal(size=(len(q), corners, q.shape[1])) * size * rng.uniform(0.1, 1.0, (len(q), 1, 1))
    spokes *= rng.random(spokes.shape) < 0.7
    weights = rng.dirichlet(np.ones(corners), (3, len(q)))
    weights[0] = np.eye(corners)[0]
    if corners == 1:
        weights *= rng.choice([-1.0, 1.0], (3, len(q), 1))
    return q, spokes, q + np.einsum("tnm,nmi->tni", weights, spokes)


@pytest.mark.parametrize("name", CELLS)
def test_kinematics_agrees_with_workspace_and_finite_differences(name: str) -> None:
    cell, _ = cell_and_world(name)
    q = valid_poses(150, name)
    bounds = WorkspaceBounds(Workspace(cell))
    pose = bounds.at(q)
    np.testing.assert_allclose(bounds.workspace.margins(q, pose), Workspace(cell).margins(q), atol=1e-12)
    np.testing.assert_allclose(
        Workspace(cell, bar=False).margins(q, pose), Workspace(cell, bar=False).margins(q), atol=1e-12
    )
    step, kinematics = 1e-6, WorkspaceBounds(Workspace(cell))
    for j in range(cell.robot.n_joints):
        dq = step * np.eye(cell.robot.n_joints)[j]
        far, near = kinematics.at(q + dq), kinematics.at(q - dq)
        turn = cell.robot.coupling_matrix[:, j]
        np.testing.assert_allclose((far.x - near.x) / (2 * step), pose.J @ turn, atol=1e-8)
        np.testing.assert_allclose((far.axis - near.axis) / (2 * step), np.cross(pose.W @ turn, pose.axis), atol=1e-8)


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("corners", [1, 3])
@pytest.mark.parametrize("size", [0.3, 0.05, 0.002])
def test_no_margin_changes_by_more_than_its_bound(name: str, corners: int, size: float) -> None:
    cell, world = cell_and_world(name)
    q, spokes, inside = neighbourhoods(name, size, corners)
    workspace = WorkspaceBounds(Workspace(cell))
    _, far = workspace.travel(q, spokes)
    allowed, loss = workspace.changes(spokes, far), PairBounds(world.scene).changes(far)
    here, distance = workspace.workspace.margins(q), world.distances(q)
    columns = [name for _, name in workspace.workspace.columns]
    cones = [k for k, c in enumerate(columns) if c.startswith("tilt")]
    spin = columns.index("twist of the tool about the bar")
    for points in inside:
        there = workspace.workspace.margins(points)
        kept = (there[:, cones] > 0.02).all(axis=1)  # the twist's bound holds where the cones do
        assert kept.sum() > 30
        over = np.abs(there - here) - allowed
        over[~kept, spin] = 0.0
        assert over.max() < 1e-9, columns[int(np.argmax(over.max(axis=0)))]
        both = np.minimum(world.distances(points), 1e9)
        apart = (both > 0.0) & (distance > 0.0)
        excess = np.where(apart, np.abs(both - distance) - loss, -1.0)
        assert excess.max() < 2e-6, world.scene.pair_name(int(np.argmax(excess.max(axis=0))))


def test_bounds_of_small_motions_are_tight() -> None:
    cell, world = cell_and_world()
    q, spokes, inside = neighbourhoods("comau-nj130/edbb", 0.002, 1)
    bounds = WorkspaceBounds(Workspace(cell))
    pose, far = bounds.travel(q, spokes)
    moved = np.linalg.norm(bounds.at(inside[0]).x - pose.x, axis=1)
    assert np.median(moved / far.move) > 0.9
    change = np.abs(bounds.at(inside[0]).length - pose.length)
    assert np.median(change / far.stretch) > 0.9
    loss = PairBounds(world.scene).changes(far)
    ratio = np.abs(world.distances(inside[0]) - world.distances(q)) / np.maximum(loss, 1e-6)
    assert np.median(ratio.max(axis=1)) > 0.5
