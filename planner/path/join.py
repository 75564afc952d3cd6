"""Joins the poses of a tour: straight joint legs where they are proven, detours over support poses elsewhere."""

from collections.abc import Sequence

import numpy as np

from planner.path.constraints import Constraints
from planner.path.lazy import LazyGraph
from planner.path.ompl_search import roadmap_edges, rrt_connect
from planner.path.path import Gaps, Leg, Path
from planner.path.shortening import cut, pull
from planner.path.verdict import verdict
from planner.units import Array, frozen

MILESTONES = 2000  # states of the pool that the roadmap uses
NEIGHBOURS = 12
SEARCH_ROUNDS = 60
RRT_ITERATIONS = 300
PASSES = 6
DRAWS = 20_000  # states drawn where no pool is given
PAD = 0.5  # [rad] by which RRT-Connect's box exceeds what the pool spans


def join(
    constraints: Constraints, q: Array, order: Sequence[int], *, seed: int = 0, pool: Array | None = None
) -> Path | Gaps:
    """Join poses in the given order by a path that keeps every constraint throughout.

    Straight legs first; then a roadmap (OMPL's PRM, proven lazily) over the pool and the poses, reused for all legs;
    then OMPL's RRT-Connect for what the roadmap leaves apart. Detours are shortened with proven motions only.

    Args:
        constraints: what every state and motion keeps.
        q: poses (n, N) [rad].
        order: rows of ``q`` in visiting order; a row may come twice.
        seed: of everything random.
        pool: valid states (P, N) [rad] to lead detours over, for instance the candidates; drawn at random if ``None``.

    Returns:
        The path, or the legs that could not be joined and the poses that cannot be reached.
    """
    order = np.asarray(order, dtype=int)
    legs = np.column_stack([order[:-1], order[1:]])
    wanted = np.unique(np.sort(legs, axis=1), axis=0)
    wanted = wanted[wanted[:, 0] != wanted[:, 1]]
    straight = constraints.prove(q[wanted[:, 0]], q[wanted[:, 1]])
    bent = wanted[~straight.proven]
    found = _detours(constraints, q, bent, seed, pool) if len(bent) else ([], None)
    ways = {(int(a), int(b)): q[[a, b]] for a, b in wanted[straight.proven]}
    ways |= {(int(a), int(b)): w for (a, b), w in zip(bent, found[0], strict=True) if w is not None}
    failed = [(int(a), int(b)) for a, b in wanted if (int(a), int(b)) not in ways]
    if failed:
        return _gaps(constraints, q, failed, found[1])
    return _path(constraints, q, legs, ways)
