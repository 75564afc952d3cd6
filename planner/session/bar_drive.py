"""The drive of a bar: tour, support poses, wanted sides of approach, blending, timing, and both collision engines."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.units import DEG, Array, read_only
from planner.design.candidates.pool import PoseSet
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathGaps, PathLeg, ProvenPath, judge_path
from planner.motion.timing.trajectory import check_limits
from planner.motion.tour.instance import slowest_axis_cost
from planner.motion.tour.solve import Method, Tour, solve_tour
from planner.session.course import Waypoints, add_blends, axis_limits, is_continuous, release_path, round_angles
from planner.session.plan_types import Drive, Role, Visit, motion_signs

REACHES = (3.0 * DEG, 1.5 * DEG, 0.75 * DEG)  # [rad] past the pose, the first that keeps every constraint


def approach_from_sides(constraints: Constraints, path: ProvenPath, wanted: Sequence[Array]) -> tuple[ProvenPath, int]:
    """Return a path that comes to its poses from the wanted sides, and at how many poses it cannot.

    Args:
        constraints: what every motion keeps.
        path: of a tour.
        wanted: sign of each axis' last movement for every node of the path (n, N); where it is 0 any will do.
    """
    signs_wanted = np.array([wanted[k] if k >= 0 else np.zeros(path.q.shape[1]) for k in path.node])
    other = ((motion_signs(path.q) != signs_wanted) & (signs_wanted != 0)).any(axis=1) & (path.node >= 0)
    at = np.flatnonzero(other)
    at = at[at > 0]
    before, pose, sign = path.q[at - 1], path.q[at], signs_wanted[at]
    past = np.full(pose.shape, np.nan)
    for reach in REACHES:
        left = np.flatnonzero(np.isnan(past[:, 0]))
        if not len(left):
            break
        way = np.clip(pose[left] - before[left], -reach, reach)
        tries = round_angles(pose[left] - np.where(sign[left] != 0, reach * sign[left], way))
        ok = _prove_motions(constraints, before[left], tries) & _prove_motions(constraints, tries, pose[left])
        past[left[ok]] = tries[ok]
    reached = ~np.isnan(past[:, 0])
    longer = _insert_supports(path, at[reached], past[reached])
    first, second = judge_path(constraints, longer.q)
    if not (first.clear and second.clear):
        return path, len(at)
    return replace(longer, verdict=first, second=second), int((~reached).sum())


def _prove_motions(constraints: Constraints, q_from: Array, q_to: Array) -> np.ndarray:
    """Whether both engines prove the straight motions, (m,) bool."""
    out = constraints.prove(q_from, q_to).proven.copy()
    which = np.flatnonzero(out)
    if len(which):
        out[which] = constraints.judge(np.stack([q_from[which], q_to[which]], axis=1)).proven
    return np.asarray(out)


def _insert_supports(path: ProvenPath, at: np.ndarray, past: Array) -> ProvenPath:
    """Put support poses (m, N) before the way points ``at`` (m,)."""
    q, node = np.insert(path.q, at, past, axis=0), np.insert(path.node, at, -1)
    node.setflags(write=False)
    places = np.flatnonzero(node >= 0)
    legs = [
        PathLeg(leg.start, leg.end, read_only(q[a + 1 : b]))
        for leg, a, b in zip(path.legs, places, places[1:], strict=False)
    ]
    return replace(path, q=read_only(q), node=node, legs=tuple(legs))


TRIES = 12  # tours re-solved with a leg forbidden
LIMIT_SAMPLES = 20_000  # of the trajectory held against the limits, beside those in every phase of its profile


@dataclass(frozen=True)
class TourStop:
    """A pose to be visited; ``approach`` (N,): wanted sign of each axis' last movement, 0 where any will do."""

    q: Array
    role: Role
    approach: Array | None = None


@dataclass(frozen=True)
class Unreachable(Exception):
    """A pose that no path joins; ``which`` is its position among the stops."""

    which: int


def drive_bar(
    cell: Cell, fixture: int, stops: Sequence[TourStop], repeats: int, pool: PoseSet, tsp: Method, seed: int, first: int
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
        path, _ = approach_from_sides(
            with_bar, path, [none, *(none if s.approach is None else s.approach for s in stops)]
        )
    travel = path_to_mount(without_bar, np.vstack([cell.home, mount]), seed)
    visits = _number_visits(cell, fixture, nodes, order, path, ["mount", *[s.role for s in stops]], first)
    measuring = _measuring_waypoints(cell, with_bar, path, visits)
    ends = np.zeros(len(travel.q), dtype=bool)
    way = add_blends(cell, without_bar, travel, ends, np.full(len(travel.q), -1))
    driven, verdicts = release_path(with_bar, without_bar, way, measuring)
    step = max(driven.trajectory.duration_s / LIMIT_SAMPLES, 0.01)
    limits = check_limits(driven.trajectory, axis_limits(cell, bar=True), step)
    return Drive(fixture, visits, tour, path, travel, driven, limits, verdicts)


def path_to_mount(constraints: Constraints, ends: Array, seed: int) -> ProvenPath:
    """The way without the bar from home to the mount pose."""
    travel = connect_poses(constraints, ends, [0, 1], seed=seed)
    if isinstance(travel, PathGaps):
        place = constraints.cell.place_name(constraints.workspace.fixture)
        raise NoSolutionError(
            f"no collision-free way leads from home to the mount pose of fixture {place}: {'; '.join(travel.reasons)}; "
            "lower motion.clearance_mm, or give another home_deg or gauge.mount_deg"
        )
    return replace(travel, q=round_angles(travel.q))


def join_tour(
    cell: Cell,
    nodes: Array,
    repeats: int,
    constraints: Constraints,
    pool: Array,
    tsp: Method,
    seed: int,
    proof: int | None = None,
) -> tuple[Tour, ProvenPath, list[int]]:
    """Return the shortest tour of the nodes (n, N) [rad] that a path joins, that path, and the nodes in its order.

    ``proof``: how far the proof that no order is shorter is carried, see :func:`planner.motion.tour.solve.solve_tour`.

    Raises:
        Unreachable: a stop cannot be reached.
        NoSolutionError: no tour joins the nodes.
    """
    cost = slowest_axis_cost(nodes, cell.robot.speed)
    forbidden: dict[tuple[int, int], str] = {}
    for _ in range(TRIES):
        tour = solve_tour(cost, start=0, end=0, forbidden=set(forbidden), method=tsp, seed=seed, nodes=proof)
        order = [*(int(k) for k in tour.order), 0]
        order += _repeat_tour(cost, order, repeats, set(forbidden), tsp, seed)
        path = connect_poses(constraints, nodes, order, seed=seed, pool=pool)
        if isinstance(path, ProvenPath):
            return _note_forbidden_legs(tour, forbidden), replace(path, q=round_angles(path.q)), order
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


def _note_forbidden_legs(tour: Tour, forbidden: dict[tuple[int, int], str]) -> Tour:
    """Say in the tour's notes that legs had to be forbidden, and why the first of them."""
    if not forbidden:
        return tour
    count, why = len(forbidden), next(iter(forbidden.values()))
    note = f"{count} legs that could not be proven were forbidden and the tour solved again (the first: {why})"
    return replace(tour, notes=(*tour.notes, note))


def _repeat_tour(
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


def _number_visits(
    cell: Cell, fixture: int, nodes: Array, order: list[int], path: ProvenPath, roles: list[Role], number: int
) -> tuple[Visit, ...]:
    """Number the poses in visiting order; the second visit of a pose is a repeat of the first."""
    at = np.flatnonzero(path.node >= 0)
    approach = motion_signs(path.q)[at]
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


def _measuring_waypoints(
    cell: Cell, constraints: Constraints, path: ProvenPath, visits: tuple[Visit, ...]
) -> Waypoints:
    """The measuring path, one way, with the blends that fit: none where the robot rests to measure or to turn back."""
    stop = path.node == 0 if is_continuous(cell) else path.node >= 0
    ids = np.full(len(path.node), -1)
    ids[path.node >= 0] = [-1 if v.role == "mount" else v.id for v in visits]
    return add_blends(cell, constraints, path, stop, ids)
