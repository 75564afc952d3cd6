"""Circular tests: from the ``[[circles]]`` of a cell to proven, timed passes and their programs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.circles import Circle
from planner.cell.setup import check_load
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages
from planner.common.units import Array, round_angles
from planner.instruments.circular.arc import plan_arc
from planner.instruments.circular.document import circular_record
from planner.instruments.circular.plan import (
    Arc,
    CircularDrive,
    CircularPass,
    CircularPlan,
    circular_course,
    measured_passes,
)
from planner.motion.collision.surroundings import left_out_pairs
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathGaps
from planner.runs.run import Mounting
from planner.session.mount import check_home
from planner.session.options import PlanOptions
from planner.session.planning import plan_session
from planner.session.release import ReleasedPath, release_way
from planner.session.tour_drive import path_to_mount

SAME_STATE = 1e-6  # [rad] a state in which the arm already stands


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
        if not cell.circles:
            raise InputError(f"{cell.path}: a circular test needs at least one [[circles]] table")
        check_loads(cell)
        self.cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
        self.seed, self.starts = seed, starts

    def drive(self, stages: Stages) -> CircularPlan:
        """Plan the circles of every fixture and the ways between them."""
        check_home(self.cell, Constraints(self.cell, bar=False))
        drives: list[CircularDrive] = []
        for mounting in sorted({c.mounting for c in self.cell.circles}):
            with stages.stage("circles"):
                arcs = self._plan_arcs([c for c in self.cell.circles if c.mounting == mounting])
            with stages.stage("path"):
                drives.append(self._join_circles(mounting, arcs, 2 * sum(len(d.passes) for d in drives)))
        notes = (*load_notes(self.cell), *_way_notes(self.cell, drives), *left_out_pairs(self.cell))
        return CircularPlan(cell=self.cell, seed=self.seed, drives=tuple(drives), notes=notes)

    def record(self, plan: CircularPlan) -> dict[str, object]:
        """Return what decides what is driven and measured."""
        return circular_record(plan)

    def _plan_arcs(self, circles: Sequence[Circle]) -> tuple[Arc, ...]:
        """Plan all circles of one fixture; the first one's beginning is the mount pose, unless the cell has one."""
        arcs: list[Arc] = []
        for circle in circles:
            near = self.starts.get(circle.name, arcs[-1].q[0] if arcs else None)
            arcs.append(plan_arc(self.cell, circle, self.seed, near))
            if self.cell.mount(circle.mounting) is None:
                mount = arcs[0].q[0] if circle.directions[0] == "ccw" else arcs[0].q[-1]
                self.cell = self.cell.with_mount(circle.mounting, mount)
        return tuple(arcs)

    def _join_circles(self, mounting: Mounting, arcs: tuple[Arc, ...], first: int) -> CircularDrive:
        """Join the circles of one fixture into a session from mount pose to mount pose."""
        cell, seed = self.cell, self.seed
        with_bar, without_bar = Constraints(cell, mounting), Constraints(cell, mounting, bar=False)
        mount = np.asarray(cell.mount(mounting))
        travel = release_way(without_bar, path_to_mount(without_bar, np.vstack([cell.home, mount]), seed))
        passes: list[CircularPass] = []
        ways: dict[bytes, ReleasedPath] = {}
        here = mount
        for one in (*measured_passes(arcs, first), None):
            goal = mount if one is None else one.path.q[0]
            if np.abs(goal - here).max() > SAME_STATE:
                key = here.tobytes() + goal.tobytes()
                if key not in ways:
                    ways[key] = _way_between(with_bar, here, goal, seed)
                passes.append(CircularPass.between(ways[key].path, last=one is None))
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
    for c in cell.circles:
        most = max(c.loads, default=0.0)
        check_load(cell, most, f"{cell.path}: circle {c.name}: loads_N goes up to {most:g} N", "load less")


def _way_between(constraints: Constraints, here: Array, goal: Array, seed: int) -> ReleasedPath:
    """The way with the bar on from one circle to the next."""
    path = connect_poses(constraints, np.vstack([here, goal]), [0, 1], seed=seed)
    if isinstance(path, PathGaps):
        raise NoSolutionError(
            f"no way with the bar on leads from one circle to the next: {'; '.join(path.reasons)}; measure them in "
            "cells of their own, or give tool_axis so that both are driven alike"
        )
    return release_way(constraints, replace(path, q=round_angles(path.q)))


def load_notes(cell: Cell) -> list[str]:
    """Say of loads that give no stiffness, and of a robot that does not say what it carries."""
    notes = [
        f"circle {c.name}: loads_N has {c.loads[0]:g} N only; a stiffness needs two loads at least, better five"
        for c in cell.circles
        if len(set(c.loads)) == 1
    ]
    if any(c.loads for c in cell.circles) and cell.robot.payload is None:
        notes.append(f"{cell.robot.name} has no payload_kg: whether it may carry the loads was not checked")
    return notes


def _way_notes(cell: Cell, drives: Sequence[CircularDrive]) -> list[str]:
    """Say of a robot that was not checked itself, and of circles that are not driven at their speed all along."""
    bare = f"{cell.robot.name} has no collision bodies: only bar and tool were checked against the surroundings"
    notes = [] if cell.robot.bodies else [bare]
    for arc in (a for d in drives for a in d.arcs):
        slowest = arc.slowest_on_sweep / arc.circle.speed
        if slowest < 0.99:
            notes.append(
                f"circle {arc.circle.name}: the tool has {100 * slowest:.0f} % of its speed where the sweep begins or "
                "at its slowest: a larger overshoot_deg, or a smaller speed_mm_s where an axis limits it, would help"
            )
    return notes
