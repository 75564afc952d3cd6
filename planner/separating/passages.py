"""Candidate poses as samples of a run: how the arm comes to them, how fast it passes, and when."""

from dataclasses import replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.rig import rig_of
from planner.run import Samples
from planner.units import Array, frozen

BETWEEN = 10.0  # [s] from pose to pose, about
TURNS = 3  # poses before that a joint's friction may remember


def passages(cell: Cell, pool: PoseSet, poses: int, seed: int) -> tuple[Samples, ...]:
    """Return the samples that one visit of each candidate gives: one at rest; in motion one for each way driven.

    Which pose comes before is not known before the tour is: each candidate is taken to be come to from another one,
    and at any time of the run.
    """
    rng = np.random.default_rng([seed, 5])
    before = pool.q[rng.permutation(len(pool))]
    way = pool.q - before
    t = rng.random(len(pool)) * poses * (BETWEEN + cell.motion.settle + cell.motion.dwell)
    at = replace(rig_of(cell).visits(pool.q, pool.fixture), t=frozen(t))
    if cell.motion.measure == "static":
        return (replace(at, direction=frozen(np.sign(way))),)
    speed, earlier = _speed(cell, pool.q, way), [pool.q[rng.permutation(len(pool))] for _ in range(TURNS)]
    there = replace(at, speed=frozen(speed), reversals=frozen(np.stack([*earlier, before], axis=2)))
    if not cell.motion.both_ways:
        return (there,)
    turned = frozen(np.stack([*earlier, pool.q + way], axis=2))
    return there, replace(there, t=frozen(2 * t.max() - t), speed=frozen(-speed), reversals=turned)


def from_both_sides(samples: Samples) -> Samples:
    """Return the visits at rest (n), and the same with every axis come from the other side (n more)."""
    assert samples.direction is not None
    twice = samples.take(np.tile(np.arange(len(samples)), 2))
    return replace(twice, direction=frozen(np.concatenate([samples.direction, -samples.direction])))


def _speed(cell: Cell, q: Array, way: Array) -> Array:
    """Speeds (n, N) [rad/s] along the ways (n, N) with the tool at measuring speed, no axis faster than it can."""
    tool = np.linalg.norm(np.einsum("nij,nj->ni", cell.map_jacobian(q), way), axis=1)
    axis = (np.abs(way) / cell.robot.speed).max(axis=1)
    seconds = np.maximum(tool / cell.motion.tool_speed, axis)
    return np.asarray(way / np.maximum(seconds, 1e-9)[:, None])
