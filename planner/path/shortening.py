"""Fewer and nearer support poses: cut corners, then pull each support towards the straight line, all proven."""

from collections.abc import Sequence

import numpy as np

from planner.path.constraints import Constraints
from planner.path.lazy import LazyGraph, leg_time
from planner.units import Array

CUT_ROUNDS = 60
PULLS = (0.9, 0.6, 0.35, 0.15)  # part of the way from a support to the straight line between its neighbours
SIDES = 2  # random neighbours of the support that are tried beside each pull


def cut(constraints: Constraints, ways: Sequence[Array]) -> list[Array]:
    """Leave out supports of ways (k, N) [rad] that proven motions between the others make needless."""
    if not ways:
        return []
    start = np.concatenate([[0], np.cumsum([len(w) for w in ways])])
    edges = [s + np.column_stack(np.triu_indices(len(w), 1)) for s, w in zip(start, ways, strict=False)]
    graph = LazyGraph(constraints, np.concatenate(ways), np.concatenate(edges))
    graph.strike(np.column_stack([start[:-1], start[1:] - 1]))  # the straight leg has failed before
    found = graph.ways(np.column_stack([start[:-1], start[1:] - 1]), CUT_ROUNDS)
    return [graph.q[f] if f else w for f, w in zip(found, ways, strict=True)]


def pull(constraints: Constraints, ways: Sequence[Array], rng: np.random.Generator, passes: int) -> list[Array]:
    """Move the supports of proven ways (k, N) [rad] to where the ways are shorter and still proven."""
    ways = [w.copy() for w in ways]
    for turn in range(passes):
        places = [(k, i) for k, w in enumerate(ways) for i in range(1 + turn % 2, len(w) - 1, 2)]
        if places:
            _pull_once(constraints, ways, places, rng)
    return ways


def _pull_once(
    constraints: Constraints, ways: list[Array], places: list[tuple[int, int]], rng: np.random.Generator
) -> None:
    before, here, after = (np.array([ways[k][i + step] for k, i in places]) for step in (-1, 0, 1))
    tries = _tries(before, here, after, rng)  # (places, tries, N)
    n, t, N = tries.shape
    ends = [np.broadcast_to(q[:, None], tries.shape).reshape(-1, N) for q in (before, after)]
    flat = tries.reshape(-1, N)
    gain = leg_time(constraints, before, here) + leg_time(constraints, here, after)
    gain = gain[:, None] - (leg_time(constraints, ends[0], flat) + leg_time(constraints, flat, ends[1])).reshape(n, t)
    better = np.flatnonzero(gain.ravel() > 1e-3 * gain.max(initial=0.0))
    proven = constraints.prove(ends[0][better], flat[better]).proven
    proven[proven] = constraints.prove(flat[better[proven]], ends[1][better[proven]]).proven
    good = np.full(n * t, -np.inf)
    good[better[proven]] = gain.ravel()[better[proven]]
    best = np.argmax(good.reshape(n, t), axis=1)
    for row, (k, i) in enumerate(places):
        if good.reshape(n, t)[row, best[row]] > 0.0:
            ways[k][i] = tries[row, best[row]]


def _tries(before: Array, here: Array, after: Array, rng: np.random.Generator) -> Array:
    """Places to try for supports (n, N): towards the straight line, and beside it, (n, tries, N) [rad]."""
    chord = after - before
    along = np.einsum("ni,ni->n", here - before, chord) / np.maximum(np.einsum("ni,ni->n", chord, chord), 1e-12)
    foot = before + np.clip(along, 0.1, 0.9)[:, None] * chord
    away = foot - here
    straight = [here + p * away for p in PULLS]
    size = np.linalg.norm(away, axis=1)[:, None] / np.sqrt(here.shape[1])
    beside = [here + p * away + 0.5 * size * rng.normal(size=here.shape) for p in PULLS for _ in range(SIDES)]
    return np.stack([*straight, *beside], axis=1)
