"""Circular tests: from the ``[[circles]]`` of a cell to proven, timed passes and their programs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.circular.assumptions import DRIVABLE
from planner.circular.configurations import COARSE_STEP, ArmPaths, check_bar, find_arm_paths, fine_angles, orientations
from planner.circular.document import circular_record
from planner.circular.plan import (
    Arc,
    Circle,
    CircularDrive,
    CircularPass,
    CircularPlan,
    circles_of,
    circular_course,
    drive_arc,
    measured_passes,
)
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import UNLIMITED, Stages, TimeLimit
from planner.common.units import Array, round_angles, to_deg
from planner.kinematics.inverse_kinematics import solve_pose_ik
from planner.motion.collision.body_gaps import describe_body_gaps
from planner.motion.collision.surroundings import describe_parked_joints, describe_unchecked_links, unchecked_links_text
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathGaps
from planner.runs.run import Mounting
from planner.session.mount import check_home
from planner.session.options import PlanOptions
from planner.session.planning import plan_session
from planner.session.release import ReleasedPath, judge_corners, release_travel
from planner.session.tour_drive import path_to_mount


def plan_circles(
    cell: Cell, options: PlanOptions, stages: Stages, starts: Mapping[str, Array] | None = None
) -> CircularPlan:
    """Plan the circular test of a cell.

    Of the roomy ways round a circle the one is driven that begins nearest to its entry in ``starts`` (name of the
    circle: controller angles (N,) [rad]), else nearest to where the arm comes from.

    Raises:
        InputError: no circle, a circle that the bar does not reach, or another key that is wrong.
        NoSolutionError: the arm does not get round a circle, or from one to the next.
    """
    return plan_session(CircularSession(cell, options.seed, starts or {}), options, stages)


class CircularSession:
    """A session of circles, see :class:`planner.session.planning.Session`."""

    def __init__(self, cell: Cell, seed: int, starts: Mapping[str, Array]) -> None:
        if not circles_of(cell):
            raise InputError(f"{cell.path}: a circular test needs at least one [[circles]] table")
        check_loads(cell)
        self.cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
        self.seed, self.starts = seed, starts

    def drive(self, stages: Stages) -> CircularPlan:
        """Plan the circles of every fixture and the ways between them."""
        check_home(self.cell, Constraints(self.cell, bar=False))
        drives: list[CircularDrive] = []
        for mounting in sorted({c.mounting for c in circles_of(self.cell)}):
            with stages.stage("circles"):
                arcs = self._plan_arcs([c for c in circles_of(self.cell) if c.mounting == mounting], stages.limit)
            with stages.stage("path"):
                first = 2 * sum(len(d.passes) for d in drives)
                drives.append(self._join_circles(mounting, arcs, first, stages.limit))
        collision = (
            *describe_body_gaps(self.cell),
            *describe_unchecked_links(self.cell),
            *describe_parked_joints(self.cell),
            *unchecked_links_text(self.cell),
        )
        notes = (*load_notes(self.cell), *_path_notes(drives), *collision)
        return CircularPlan(cell=self.cell, seed=self.seed, drives=tuple(drives), notes=notes)

    def record(self, plan: CircularPlan) -> dict[str, object]:
        """Return the part of the plan that fixes what is driven and measured, of which its id is the hash."""
        return circular_record(plan)

    def _plan_arcs(self, circles: Sequence[Circle], limit: TimeLimit) -> tuple[Arc, ...]:
        """Plan all circles of one fixture; the first one's beginning is the mount pose, unless the cell has one."""
        arcs: list[Arc] = []
        for circle in circles:
            near = self.starts.get(circle.name, arcs[-1].q[0] if arcs else None)
            arcs.append(plan_arc(self.cell, circle, self.seed, near, limit))
            if self.cell.mount(circle.mounting) is None:
                mount = arcs[0].q[0] if circle.directions[0] == "ccw" else arcs[0].q[-1]
                self.cell = self.cell.with_mount(circle.mounting, mount)
        return tuple(arcs)

    def _join_circles(self, mounting: Mounting, arcs: tuple[Arc, ...], first: int, limit: TimeLimit) -> CircularDrive:
        """Join the circles of one fixture into a session from mount pose to mount pose."""
        cell, seed = self.cell, self.seed
        with_bar, without_bar = (Constraints(cell, mounting, bar, limit=limit) for bar in (True, False))
        mount = np.asarray(cell.mount(mounting))
        travel = release_travel(without_bar, path_to_mount(without_bar, np.vstack([cell.home, mount]), seed))
        passes: list[CircularPass] = []
        ways: dict[bytes, ReleasedPath] = {}
        here = mount
        for one in (*measured_passes(arcs, first), None):
            goal = mount if one is None else one.path.q[0]
            if np.abs(goal - here).max() > 1e-6:  # [rad] else the arm already stands there
                key = here.tobytes() + goal.tobytes()
                if key not in ways:
                    ways[key] = _path_between(with_bar, here, goal, seed)
                passes.append(CircularPass.from_path(ways[key].path, last=one is None))
            if one is not None:
                passes.append(one)
                here = one.path.q[-1]
        verdicts = (*travel.verdicts, *(v for w in ways.values() for v in w.verdicts))
        course = circular_course(cell, mounting, travel.path, passes)
        return CircularDrive(course=course, verdicts=verdicts, arcs=arcs)


def check_loads(cell: Cell) -> None:
    """Refuse circles with a load beyond what the robot may carry beside its tool.

    Raises:
        InputError: with the load, the circle and what is allowed.
    """
    for c in circles_of(cell):
        most = max(c.loads, default=0.0)
        cell.check_load(most, f"{cell.path}: circle {c.name}: loads_N goes up to {most:g} N", "load less")


def _path_between(constraints: Constraints, here: Array, goal: Array, seed: int) -> ReleasedPath:
    """The way with the bar on from one circle to the next."""
    path = connect_poses(constraints, np.vstack([here, goal]), [0, 1], seed=seed)
    if isinstance(path, PathGaps):
        raise NoSolutionError(
            f"no path with the bar on leads from one circle to the next: {'; '.join(path.reasons)}; measure them in "
            "cells of their own, or give tool_axis so that both are driven alike"
        )
    return release_travel(constraints, replace(path, q=round_angles(path.q)))


def load_notes(cell: Cell) -> list[str]:
    """Say of loads that give no stiffness, and of a robot that does not say what it carries."""
    notes = [
        f"circle {c.name}: loads_N has {c.loads[0]:g} N only; a stiffness needs two loads at least, better five"
        for c in circles_of(cell)
        if len(set(c.loads)) == 1
    ]
    if any(c.loads for c in circles_of(cell)) and cell.robot.payload is None:
        notes.append(f"{cell.robot.name} has no payload_kg: whether it may carry the loads was not checked")
    return notes


def _path_notes(drives: Sequence[CircularDrive]) -> list[str]:
    """Say of circles that are not driven at their speed all along."""
    notes = []
    for arc in (a for d in drives for a in d.arcs):
        slowest = arc.slowest_on_sweep / arc.circle.speed
        if slowest < 0.99:
            notes.append(
                f"circle {arc.circle.name}: the tool has {100 * slowest:.0f} % of its speed where the sweep begins or "
                "at its slowest: a larger overshoot_deg, or a smaller speed_mm_s where an axis limits it, would help"
            )
    return notes


def plan_arc(cell: Cell, circle: Circle, seed: int = 0, near: Array | None = None, limit: TimeLimit = UNLIMITED) -> Arc:
    """Plan the way round a circle: of the roomy ones the nearest.

    Args:
        cell: where a fixture has a mount pose, the twist of a cable along the bar counts from there; else from the
            beginning of the circle, which becomes the mount pose.
        circle: one of the cell's.
        seed: of everything random.
        near: the state from which the arm comes (N,) [rad], home if ``None``.
        limit: of the time that a plan may take.

    Raises:
        InputError: the bar does not reach round.
        NoSolutionError: the arm does not; or it collides.
    """
    most_trials = 6  # ways that are driven finely and judged before the circle is given up
    check_bar(cell, circle)
    ways = find_arm_paths(cell, circle, seed)
    constraints = Constraints(cell, circle.mounting, limit=limit)
    n = cell.robot.n_joints
    hits = constraints.world.find_near(ways.q.reshape(-1, n), constraints.clearance).reshape(ways.q.shape[:2])
    free = np.flatnonzero(~hits.any(axis=1))
    if not len(free):
        raise NoSolutionError(_explain_collision(constraints, circle, ways, hits))
    why = ""
    for k in _order_paths(cell, ways, free, cell.home if near is None else near)[:most_trials]:
        arc, why = _finish_arc(cell, circle, ways, k, len(free), constraints)
        if arc is not None:
            return arc
    raise NoSolutionError(
        f"circle {circle.name}: {len(free)} ways round are free at places {to_deg(COARSE_STEP):.0f}° apart, but none of"
        f" the first {most_trials} is proven in between ({why}): lower motion.clearance_mm, or move the circle"
    )


def _order_paths(cell: Cell, ways: ArmPaths, free: np.ndarray, near: Array) -> list[int]:
    """Roomy ways by the time that it takes to come to their beginning, then the others by their room."""
    away = (np.abs(ways.q[free, 0] - near) / cell.robot.speed).max(axis=1)
    roomy = ways.room[free] >= DRIVABLE.roomy_share * ways.room[free[0]]
    return [int(k) for k in free[np.lexsort((np.round(np.where(roomy, away, -ways.room[free]), 6), ~roomy))]]


def _finish_arc(
    cell: Cell, circle: Circle, ways: ArmPaths, k: int, free: int, constraints: Constraints
) -> tuple[Arc | None, str]:
    """Drive one way finely; returned is it, or a sentence that says what is wrong with it."""
    angle = fine_angles(circle)
    guess = np.column_stack([np.interp(angle, ways.angle, column) for column in ways.q[k].T])
    wanted = circle.points(angle), orientations(circle, angle, ways.R_BF[k])
    # 12: rounds of Newton from the coarse places to the points between
    q, good = solve_pose_ik(cell.chain, cell.robot, guess, *wanted, 12)
    if not good.all():
        return None, f"the arm loses its configuration at {to_deg(angle[np.argmin(good)]):.0f}°"
    q = round_angles(q)
    if cell.mount(circle.mounting) is None:
        constraints = _with_mount(constraints, q[0] if circle.directions[0] == "ccw" else q[-1])
    arc = drive_arc(cell, circle, angle, q, cell.motion.blend or cell.motion.clearance)
    verdicts, _ = judge_corners(constraints, q, arc.ccw.trajectory)
    bad = [f for v in verdicts for f in v.failures]
    if bad:
        return None, bad[0]
    return replace(arc, verdicts=verdicts, told=f"{ways.told}, {free} of these without collision"), ""


def _with_mount(constraints: Constraints, mount: Array) -> Constraints:
    """Count the cable's twist along the bar from a mount pose."""
    held = constraints.workspace.mounting
    cell = constraints.cell.with_mount(held, mount)
    return Constraints(cell, held, constraints.bar, constraints.scene, constraints.room, constraints.limit)


def _explain_collision(constraints: Constraints, circle: Circle, ways: ArmPaths, hits: np.ndarray) -> str:
    """Say where the way that collides least does so, and with what."""
    best = int(np.argmin(hits.sum(axis=1)))
    k = int(np.argmax(hits[best]))
    why = constraints.reason(ways.q[best, k]) or "a collision"
    return (
        f"circle {circle.name}: {ways.told}, but each collides somewhere; the one that does least often first at "
        f"{to_deg(ways.angle[k]):.0f}°: {why}; move the circle or the fixture, change radius_mm, give tool_axis, "
        "or lower motion.clearance_mm"
    )
