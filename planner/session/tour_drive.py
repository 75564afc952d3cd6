"""The drive of one mounting: tour, support poses, approaches, blending, timing, and both collision engines.

Where balls are centred, the tour runs over the poses that they are approached from. The last way to a ball is inserted
where the tour stops there. All of it starts and ends at the mount pose: where the bar is attached, the head is mastered
or the reflector is put in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.cell.cell import Cell
from planner.cell.places import joint_keys
from planner.common.choices import TourSolver
from planner.common.errors import NoSolutionError
from planner.common.second_process import ForkedTask
from planner.common.summary import Aside
from planner.common.units import Array, read_only
from planner.design.candidates.balls import FirstContact
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import Roadmap
from planner.motion.path.verdict import PathGaps, ProvenPath
from planner.motion.timing.leg_times import axis_limits
from planner.motion.timing.trajectory import check_limits
from planner.motion.tour.solve import Tour, solve_tour
from planner.runs.run import Mounting
from planner.session.plan_types import Course, Drive, Visit, motion_signs, reading_limits, time_measuring
from planner.session.release import (
    TourStop,
    add_blends,
    approach_from_sides,
    insert_ball_approaches,
    release_path,
    release_travel,
    separate_motions,
)
from planner.session.tour_cost import prove_shortcuts, tour_costs


@dataclass(frozen=True)
class MountingSession:
    """What is measured with the gauge held in one way, and how the arm may move there.

    Attributes:
        measuring: what the robot keeps while it measures; travelling: on the way there and back.
        detours: states over which detours lead (P, N) [rad], or a roadmap of them.
        repeats: how many poses are visited again at the end.
    """

    measuring: Constraints
    travelling: Constraints
    detours: Array | Roadmap
    repeats: int = 0

    @property
    def cell(self) -> Cell:
        """The cell with the tool point that is used there."""
        return self.measuring.cell

    @property
    def mounting(self) -> Mounting:
        """At which fixture and tool point."""
        return self.measuring.workspace.mounting

    @property
    def mount(self) -> Array:
        """The pose in which the session starts and ends, (N,) [rad]."""
        return np.asarray(self.cell.mount(self.mounting))


@dataclass(frozen=True)
class Unreachable(Exception):
    """Poses that no path joins; ``which`` are their positions among the stops."""

    which: tuple[int, ...]


def drive_tour(place: MountingSession, stops: Sequence[TourStop], tsp: TourSolver, seed: int, first: int = 0) -> Drive:
    """Join the stops of one fixture into a driven, timed and twice-judged tour from the mount pose and back to it.

    Args:
        place: where it is driven.
        stops: the poses.
        tsp, seed: of the tour's solver, and of everything random.
        first: number of the first visit; those of earlier fixtures come before.

    Raises:
        Unreachable: stops cannot be reached; replace them and call again.
        NoSolutionError: no tour joins the poses, or a judge rejects the path.
    """
    cell, constraints = place.cell, place.measuring
    stops = [TourStop(place.mount, "mount"), *stops]  # as the tour counts its nodes
    nodes = np.array([s.node for s in stops])
    tour, path = join_tour(place, nodes, np.array([s.lap for s in stops]), tsp, seed)
    if any(s.approach is not None for s in stops):
        sides = [np.zeros(nodes.shape[1]) if s.approach is None else s.approach for s in stops]
        path = approach_from_sides(constraints, path, np.array(sides))
    travel = path_to_mount(place.travelling, np.vstack([cell.home, place.mount]), seed)
    path, touched = insert_ball_approaches(path, stops)
    visits = _number_visits(place, path, stops, first)
    rests = (path.node == 0 if cell.motion.is_continuous else path.node >= 0) | touched
    ids = np.full(len(path.node), -1)
    ids[path.node >= 0] = [-1 if v.role == "mount" else v.id for v in visits]
    points = add_blends(constraints, path, rests, ids)
    separate = separate_motions(constraints, [stops[k].ball if k >= 0 else -1 for k in path.node])
    measuring = release_path(constraints, points, lambda p: time_measuring(cell, p, place.mounting), separate)
    # 20_000: samples held against the limits, beside those in every phase of its profile
    step = max(measuring.path.trajectory.duration_s / 20_000, 0.01)
    reading = reading_limits(cell, place.mounting, bar=True)
    task = partial(check_limits, measuring.path.trajectory, axis_limits(cell, bar=True), step, reading)
    with ForkedTask(task) as checking:
        travelling = release_travel(place.travelling, travel)
        shortcuts = prove_shortcuts(constraints, points.q, points.visit)
    path = replace(
        path, verdict=measuring.verdicts[0], second=measuring.verdicts[1]
    )  # with its blends, as it is driven
    course = Course.of_poses(cell, place.mounting, travelling.path, measuring.path, shortcuts)
    limits = checking.result()
    verdicts = measuring.verdicts + travelling.verdicts
    return Drive(course=course, verdicts=verdicts, visits=visits, tour=tour, path=path, limits=limits)


def path_to_mount(constraints: Constraints, ends: Array, seed: int) -> ProvenPath:
    """The path without the bar from home to the mount pose."""
    travel = connect_poses(constraints, ends, [0, 1], seed=seed)
    if isinstance(travel, PathGaps):
        cell = constraints.cell
        place, home = cell.place_name(constraints.workspace.mounting), joint_keys(cell.robot, "home")
        raise NoSolutionError(
            f"no collision-free path leads from home to the mount pose of fixture {place}: {'; '.join(travel.reasons)}"
            f"; lower motion.clearance_mm, or give another {home}, or gauge.mount_deg"
        )
    return travel


def proof_nodes(poses: int) -> int:
    """Return how many nodes of a tree the proof of a tour is worth: each takes longer the more poses there are.

    Beyond 250 poses the bound stands at a fraction of a per cent, and thousands of nodes take minutes to move it.
    """
    # no tree is searched beyond 250 poses; else it has 2000 nodes at 200 poses, and 100 000 at most
    return 0 if poses > 250 else min(100_000, int(2_000 * (200 / poses) ** 5))


def join_tour(
    place: MountingSession, nodes: Array, lap: np.ndarray, tsp: TourSolver, seed: int
) -> tuple[Tour, ProvenPath]:
    """Return the shortest tour of the nodes (n, N) [rad] that a path joins, and that path.

    Each ``lap`` (n,) of the nodes is a tour of its own, from node 0 back to it; all are returned as one.

    Raises:
        Unreachable: stops cannot be reached.
        NoSolutionError: no tour joins the nodes.
    """
    most_tours = 12  # re-solved with a leg forbidden
    cost = tour_costs(place.cell, place.mounting, nodes)
    forbidden: dict[tuple[int, int], str] = {}
    poses = np.arange(1, len(nodes))
    for _ in range(most_tours):
        no = set(forbidden)
        laps = [_lap(cost, poses[lap[1:] == k].tolist(), place, no, tsp, seed) for k in np.unique(lap)]
        order = [*(int(k) for own in laps for k in own.order), 0]
        order += _repeat_tour(cost, order, place, no, tsp, seed)
        tour = _one_after_the_other(laps)
        path = connect_poses(place.measuring, nodes, order, seed=seed, pool=place.detours)
        if isinstance(path, ProvenPath):
            return _note_forbidden_legs(tour, forbidden), path
        if 0 in path.unreachable:
            raise NoSolutionError(f"no path leads from the mount pose to any other pose: {path.reasons[0]}")
        if path.unreachable:
            raise Unreachable(tuple(k - 1 for k in path.unreachable))
        forbidden |= dict(zip(path.failed, path.reasons, strict=True))
    why = "; ".join(sorted(set(forbidden.values()))[:3])
    raise NoSolutionError(
        f"path: no collision-free tour joins the {len(nodes)} poses after {most_tours} tries; {len(forbidden)} "
        f"segments are impossible ({why}): lower motion.clearance_mm, widen the cones, move the fixture away "
        "from what is in the way, or try another --seed"
    )


def _note_forbidden_legs(tour: Tour, forbidden: dict[tuple[int, int], str]) -> Tour:
    """Say in the tour's notes that segments had to be forbidden, and why the first of them."""
    if not forbidden:
        return tour
    count, why = len(forbidden), next(iter(forbidden.values()))
    note = f"{count} segments that could not be proven were forbidden and the tour solved again (the first: {why})"
    return replace(tour, notes=(*tour.notes, Aside(note)))


def _lap(
    cost: Array, poses: list[int], place: MountingSession, forbidden: set[tuple[int, int]], tsp: TourSolver, seed: int
) -> Tour:
    """Return the shortest tour from node 0 through some poses and back."""
    nodes = [0, *poses]
    inside = {(nodes.index(a), nodes.index(b)) for a, b in forbidden if a in nodes and b in nodes}
    own, limit = cost[np.ix_(nodes, nodes)], place.measuring.limit
    tour = solve_tour(own, forbidden=inside, method=tsp, seed=seed, nodes=proof_nodes(len(nodes)), limit=limit)
    return replace(tour, order=read_only(np.array(nodes)[tour.order]))


def _one_after_the_other(laps: Sequence[Tour]) -> Tour:
    """Return the order of all nodes over some laps, node 0 at its beginning alone, with what all cost together."""
    if len(laps) == 1:
        return laps[0]
    return Tour(
        order=read_only(np.concatenate([laps[0].order, *(own.order[1:] for own in laps[1:])])),
        unsorted_s=sum(own.unsorted_s for own in laps),
        cost_s=sum(own.cost_s for own in laps),
        lower_bound_s=sum(own.lower_bound_s for own in laps),
        optimal=all(own.optimal for own in laps),
        solver=", ".join(dict.fromkeys(own.solver for own in laps)),
        notes=tuple(dict.fromkeys(note for own in laps for note in own.notes)),
    )


def _repeat_tour(
    cost: Array, order: list[int], place: MountingSession, forbidden: set[tuple[int, int]], tsp: TourSolver, seed: int
) -> list[int]:
    """Poses visited a second time at the end, spread evenly along the tour: their scatter is the noise floor."""
    inner = [k for k in order if k != 0]
    if place.repeats == 0 or not inner:
        return []
    again = [inner[k] for k in np.unique(np.linspace(0, len(inner) - 1, min(place.repeats, len(inner))).astype(int))]
    tour = _lap(cost, again, place, forbidden, tsp, seed)
    return [*tour.order[1:].tolist(), 0]


def _number_visits(
    place: MountingSession, path: ProvenPath, stops: Sequence[TourStop], number: int
) -> tuple[Visit, ...]:
    """Number the poses in visiting order; a further visit of a pose is a repeat of the first."""
    cell, at = place.cell, np.flatnonzero(path.node >= 0)
    nodes, approach = path.node[at].tolist(), motion_signs(path.q)[at]
    q = np.array([s.q for s in stops])[nodes] if place.measuring.bar else path.q[at]
    length = cell.bar_length(q, place.mounting)
    head = FirstContact.of(cell) if any(s.ball >= 0 for s in stops) else None
    contact = None if head is None else head.at(q)
    first: dict[int, int] = {}
    visits = []
    for k, node in enumerate(nodes):
        stop, again = stops[node], node in first and node != 0
        visits.append(
            Visit(
                id=number + k,
                q=q[k],
                length=float(length[k]),
                mounting=place.mounting,
                role="repeat" if again else stop.role,
                approach=tuple(int(s) for s in approach[k]),
                repeats=first.get(node) if again else None,
                ball=stop.ball,
                contact=None if contact is None or stop.ball < 0 else float(contact[k]),
            )
        )
        first.setdefault(node, number + k)
    return tuple(visits)
