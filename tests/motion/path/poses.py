"""Valid poses of the shipped cells, found by plain rejection: no candidate generator is trusted here."""

from functools import cache

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.cell.workspace import Workspace
from planner.common.units import Array
from planner.motion.collision.engines import CollisionWorld


@cache
def cell_and_world(name: str = "comau-nj130/edbb") -> tuple[Cell, CollisionWorld]:
    cell = load_cell(name)
    return cell, CollisionWorld.from_cell(cell)


@cache
def valid_poses(count: int, name: str = "comau-nj130/edbb") -> Array:
    cell, world = cell_and_world(name)
    rng, workspace, robot = np.random.default_rng(7), Workspace(cell), cell.robot
    low, high = np.maximum(robot.q_lower, -np.pi), np.minimum(robot.q_upper, np.pi)
    found: list[Array] = []
    while sum(map(len, found)) < count:
        q = rng.uniform(low, high, (200_000, robot.n_joints))
        length = np.linalg.norm(cell.map_position(q) - cell.fixtures[0].p_BX, axis=1)
        q = q[(length > cell.gauge.length_min) & (length < cell.gauge.length_max)]
        q = q[(workspace.margins(q) > 0.0).all(axis=1)]
        found.append(q[~world.collides(q)])
    return np.concatenate(found)[:count]


def dense(q_from: Array, q_to: Array, steps: int) -> Array:
    """States along straight joint motions (m, N), (m * (steps + 1), N)."""
    s = np.linspace(0.0, 1.0, steps + 1)[None, :, None]
    return np.asarray(((1 - s) * q_from[:, None] + s * q_to[:, None]).reshape(-1, q_from.shape[1]))
