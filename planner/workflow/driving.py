"""From chosen poses to a timed path: tour, support poses, blending, timing, and both judges."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.errors import NoSolutionError
from planner.gauge import bar_state
from planner.path import Constraints, Gaps, Path, Verdict, join, judge
from planner.plan import Drive, Role, Visit, Waypoints, axis_limits, course, is_continuous, settled, signs, tool_speed
from planner.tour import Method, Tour, slowest_axis_cost, solve_tour
from planner.trajectory import Trajectory, blend_corners, check_limits
from planner.units import Array

TRIES = 12  # tours re-solved with a leg forbidden
LIMIT_SAMPLES = 20_000  # of the trajectory held against the limits, beside those in every phase of its profile
HALVINGS = 4  # of a blend that does not fit, before it becomes a stop


@dataclass(frozen=True)
class Stop:
    """A pose to be visited."""

    q: Array
    role: Role


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
    with_bar, without_bar = Constraints(cell, fixture), Constraints(cell, fixture, bar=False)
    mount = np.asarray(cell.fixtures[fixture].mount)
    nodes = np.vstack([mount, *[s.q for s in stops]])
    near = pool.q[pool.fixture == fixture]
    tour, path, order = _join_tour(cell, nodes, repeats, with_bar, near, tsp, seed)
    travel = join(without_bar, np.vstack([cell.home, mount]), [0, 1], seed=seed)
    if isinstance(travel, Gaps):
        why = "; ".join(travel.reasons)
        raise NoSolutionError(
            f"no collision-free way leads from home to the mount pose of fixture {fixture + 1}: {why}"
        )
    travel = replace(travel, q=settled(travel.q))
    visits = _visits(cell, fixture, nodes, order, path, ["mount", *[s.role for s in stops]], first)
    measuring = _measuring(cell, with_bar, path, visits)
    ends = np.zeros(len(travel.q), dtype=bool)
    way = _blended(cell, without_bar, travel, ends, np.full(len(travel.q), -1))
    driven = course(cell, fixture, way, measuring)
    step = max(driven.trajectory.duration_s / LIMIT_SAMPLES, 0.01)
    limits = check_limits(driven.trajectory, axis_limits(cell, bar=True), step)
    verdicts = _judged(with_bar, driven.measuring, len(path.q), driven.trajectory)
    verdicts += _judged(without_bar, way, len(way.q), driven.travel_trajectory)
    return Drive(fixture, visits, tour, path, travel, driven, limits, verdicts)


def _judged(constraints: Constraints, path: Waypoints, count: int, trajectory: Trajectory) -> tuple[Verdict, ...]:
    """Both engines' verdicts on the legs and on the triangle under every blend (the way back has the same).

    Raises:
        NoSolutionError: an engine does not prove the path; nothing is written for it.
    """
    corner = np.flatnonzero(~trajectory.stop[:count])
    triangles = np.stack([trajectory.entry[corner], path.q[corner], trajectory.exit[corner]], axis=1)
    verdicts = judge(constraints, path.q[:count], triangles)
    for v in verdicts:
        if not v.clear:
            raise NoSolutionError(f"{v.engine} does not prove the path: {'; '.join(v.failures[:3])}")
    return verdicts


def _join_tour(
    cell: Cell, nodes: Array, repeats: int, constraints: Constraints, pool: Array, tsp: Method, seed: int
) -> tuple[Tour, Path, list[int]]:
    cost = slowest_axis_cost(nodes, cell.robot.speed)
    forbidden: set[tuple[int, int]] = set()
    for _ in range(TRIES):
        tour = solve_tour(cost, start=0, end=0, forbidden=forbidden, method=tsp, seed=seed)
        order = [*(int(k) for k in tour.order), 0]
        order += _second_round(cost, order, repeats, forbidden, tsp, seed)
        path = join(constraints, nodes, order, seed=seed, pool=pool)
        if isinstance(path, Path):
            return tour, replace(path, q=settled(path.q)), order
        if 0 in path.unreachable:
            raise NoSolutionError(f"no path leads from the mount pose to any other pose: {path.reasons[0]}")
        if path.unreachable:
            raise Unreachable(path.unreachable[0] - 1)
        forbidden |= set(path.failed)
    raise NoSolutionError(
        f"no collision-free tour joins the poses after {TRIES} tries ({len(forbidden)} legs are impossible): "
        "lower motion.clearance_mm, widen the cones, or move the fixture away from what is in the way"
    )


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
    length = bar_state(cell.map_position(nodes), cell.fixtures[fixture].p_BX).length
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
    return _blended(cell, constraints, path, stop, ids)


def _blended(cell: Cell, constraints: Constraints, path: Path, stop: np.ndarray, ids: np.ndarray) -> Waypoints:
    rest = stop.copy()
    rest[[0, -1]] = True
    return Waypoints(path.q, ids, np.round(fitting_blends(cell, constraints, path.q, rest), 12))


def fitting_blends(cell: Cell, constraints: Constraints, q: Array, stop: np.ndarray) -> Array:
    """Largest blend radius at each path point, (m,) [m], whose whole corner is proven to keep every constraint.

    A blend that does not fit is halved; after some halvings the corner becomes a stop (radius 0).
    """
    blend = np.where(stop, 0.0, cell.motion.blend)
    for attempt in range(HALVINGS + 1):
        entry, leave, at_rest = blend_corners(
            q,
            stop=stop | (blend == 0),
            blend_m=blend,
            tool_position=cell.map_position,
            limits=axis_limits(cell, constraints.bar),
            tool_speed=tool_speed(cell, constraints.bar),
        )
        corner = np.flatnonzero(~at_rest)
        if not len(corner):
            break
        proof = constraints.prove_triangles(entry[corner], q[corner], leave[corner])
        failed = corner[~proof.proven]
        if not len(failed):
            break
        blend[failed] = blend[failed] / 2 if attempt < HALVINGS else 0.0
    return blend
