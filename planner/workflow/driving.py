"""From chosen poses to a timed path: tour, support poses, blending, timing, and both judges."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.errors import NoSolutionError
from planner.path import Constraints, Gaps, Path, join
from planner.plan import (
    Drive,
    Role,
    Visit,
    Waypoints,
    axis_limits,
    is_continuous,
    settled,
    signs,
)
from planner.tour import Method, Tour, slowest_axis_cost, solve_tour
from planner.trajectory import check_limits
from planner.units import Array
from planner.workflow.approaching import approached
from planner.workflow.releasing import blended, released

TRIES = 12  # tours re-solved with a leg forbidden
LIMIT_SAMPLES = 20_000  # of the trajectory held against the limits, beside those in every phase of its profile


@dataclass(frozen=True)
class Stop:
    """A pose to be visited; ``approach`` (N,): wanted sign of each axis' last movement, 0 where any will do."""

    q: Array
    role: Role
    approach: Array | None = None


@dataclass(frozen=True)
class Unreachable(Exception):
    """A pose that no path joins; ``which`` is its position among the stops."""

    which: int


def drive(
    cell: Cell, fixture: int, stops: Sequence[Stop], repeats: int, pool: PoseSet, tsp: Method, seed: int, first: int
) -> Drive:
    """Join the stops of one fixture into a driven, timed and twice-judged tour from mount to mount.

    ``first`` is the number of the first visit; those of earlier fixtures come before.

    Raises:
        Unreachable: a stop cannot be reached; replace it and call again.
        NoSolutionError: no tour joins the poses, or a judge rejects the path.
    """
    cell = cell.at(fixture)
    with_bar, without_bar = Constraints(cell, fixture), Constraints(cell, fixture, bar=False)
    mount = np.asarray(cell.fixtures[fixture].mount)
    nodes = np.vstack([mount, *[s.q for s in stops]])
    near = pool.q[pool.fixture == fixture]
    tour, path, order = join_tour(cell, nodes, repeats, with_bar, near, tsp, seed)
    if any(s.approach is not None for s in stops):
        none = np.zeros(nodes.shape[1])
        path, _ = approached(with_bar, path, [none, *(none if s.approach is None else s.approach for s in stops)])
    travel = way_to_mount(without_bar, np.vstack([cell.home, mount]), seed)
    visits = _visits(cell, fixture, nodes, order, path, ["mount", *[s.role for s in stops]], first)
    measuring = _measuring(cell, with_bar, path, visits)
    ends = np.zeros(len(travel.q), dtype=bool)
    way = blended(cell, without_bar, travel, ends, np.full(len(travel.q), -1))
    driven, verdicts = released(with_bar, without_bar, way, measuring)
    step = max(driven.trajectory.duration_s / LIMIT_SAMPLES, 0.01)
    limits = check_limits(driven.trajectory, axis_limits(cell, bar=True), step)
    return Drive(fixture, visits, tour, path, travel, driven, limits, verdicts)


def way_to_mount(constraints: Constraints, ends: Array, seed: int) -> Path:
    """The way without the bar from home to the mount pose."""
    travel = join(constraints, ends, [0, 1], seed=seed)
    if isinstance(travel, Gaps):
        place = constraints.cell.place_name(constraints.workspace.fixture)
        raise NoSolutionError(
            f"no collision-free way leads from home to the mount pose of fixture {place}: {'; '.join(travel.reasons)}; "
            "lower motion.clearance_mm, or give another home_deg or gauge.mount_deg"
        )
    return replace(travel, q=settled(travel.q))


def join_tour(
    cell: Cell,
    nodes: Array,
    repeats: int,
    constraints: Constraints,
    pool: Array,
    tsp: Method,
    seed: int,
    proof: int | None = None,
) -> tuple[Tour, Path, list[int]]:
    """Return the shortest tour of the nodes (n, N) [rad] that a path joins, that path, and the nodes in its order.

    ``proof``: how far the proof that no order is shorter is carried, see :func:`planner.tour.solve_tour`.

    Raises:
        Unreachable: a stop cannot be reached.
        NoSolutionError: no tour joins the nodes.
    """
    cost = slowest_axis_cost(nodes, cell.robot.speed)
    forbidden: dict[tuple[int, int], str] = {}
    for _ in range(TRIES):
        tour = solve_tour(cost, start=0, end=0, forbidden=set(forbidden), method=tsp, seed=seed, nodes=proof)
        order = [*(int(k) for k in tour.order), 0]
        order += _second_round(cost, order, repeats, set(forbidden), tsp, seed)
        path = join(constraints, nodes, order, seed=seed, pool=pool)
        if isinstance(path, Path):
            return _told(tour, forbidden), replace(path, q=settled(path.q)), order
        if 0 in path.unreachable:
            raise NoSolutionError(f"no path leads from the mount pose to any other pose: {path.reasons[0]}")
        if path.unreachable:
            raise Unreachable(path.unreachable[0] - 1)
        forbidden |= dict(zip(path.failed, path.reasons, strict=True))
    why = "; ".join(sorted(set(forbidden.values()))[:3])
    raise NoSolutionError(
        f"path: no collision-free tour joins the {len(nodes)} poses after {TRIES} tries; {len(forbidden)} legs are "
        f"impossible ({why}): lower motion.clearance_mm, widen the cones, move the fixture away from what is in the "
        "way, or try another --seed"
    )


def _told(tour: Tour, forbidden: dict[tuple[int, int], str]) -> Tour:
    """Say in the tour's notes that legs had to be forbidden, and why the first of them."""
    if not forbidden:
        return tour
    count, why = len(forbidden), next(iter(forbidden.values()))
    note = f"{count} legs that could not be proven were forbidden and the tour solved again (the first: {why})"
    return replace(tour, notes=(*tour.notes, note))


def _second_round(
    cost: Array, order: list[int], repeats: int, forbidden: set[tuple[int, int]], tsp: Method, seed: int
) -> list[int]:
    """Poses visited a second time at the end, spread evenly along the tour: their scatter is the noise floor."""
    inner = order[1:-1]
    if repeats == 0 or not inner:
        return []
    again = [inner[k] for k in np.unique(np.linspace(0, len(inner) - 1, min(repeats, len(inner))).astype(int))]
    nodes = [0, *again]
    inside = {(nodes.index(a), nodes.index(b)) for a, b in forbidden if a in nodes and b in nodes}
    tour = solve_tour(cost[np.ix_(nodes, nodes)], start=0, end=0, forbidden=inside, method=tsp, seed=seed)
    return [*(nodes[k] for k in tour.order[1:]), 0]


def _visits(
    cell: Cell, fixture: int, nodes: Array, order: list[int], path: Path, roles: list[Role], number: int
) -> tuple[Visit, ...]:
    """Number the poses in visiting order; the second visit of a pose is a repeat of the first."""
    at = np.flatnonzero(path.node >= 0)
    approach = signs(path.q)[at]
    length = cell.bar_length(nodes, fixture)
    first: dict[int, int] = {}
    visits = []
    for k, (node, sign) in enumerate(zip(order, approach, strict=True), start=number):
        again = node in first and node != 0
        role = "repeat" if again else roles[node]
        visits.append(
            Visit(
                k,
                nodes[node],
                float(length[node]),
                fixture,
                role,
                tuple(int(s) for s in sign),
                first.get(node) if again else None,
            )
        )
        first.setdefault(node, k)
    return tuple(visits)


def _measuring(cell: Cell, constraints: Constraints, path: Path, visits: tuple[Visit, ...]) -> Waypoints:
    """The measuring path, one way, with the blends that fit: none where the robot rests to measure or to turn back."""
    stop = path.node == 0 if is_continuous(cell) else path.node >= 0
    ids = np.full(len(path.node), -1)
    ids[path.node >= 0] = [-1 if v.role == "mount" else v.id for v in visits]
    return blended(cell, constraints, path, stop, ids)
