"""Circular tests: from the ``[[circles]]`` of a cell to proven, timed passes and their programs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.circles import Circle
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages
from planner.common.units import Array
from planner.instruments.circular.arc import check_loads, load_notes, plan_arc
from planner.instruments.circular.plan import (
    Arc,
    CircularDrive,
    CircularPass,
    CircularPlan,
    circular_identity,
    measured_passes,
)
from planner.instruments.circular.program import circle_program
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathGaps, ProvenPath
from planner.programs.program_files import shared_notes
from planner.session.course import round_angles
from planner.session.mount import check_home
from planner.session.neutral_program import assemble_programs, write_programs
from planner.session.options import PlanOptions
from planner.session.release import ReleasedPath, blend_way, release_path

SAME_STATE = 1e-6  # [rad] a state in which the arm already stands


@on_one_thread
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
    if not cell.circles:
        raise InputError(f"{cell.path}: a circular test needs at least one [[circles]] table")
    check_loads(cell)
    dialects = options.known_dialects(cell)
    cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
    check_home(cell, Constraints(cell, bar=False))
    drives: list[CircularDrive] = []
    for fixture in sorted({c.fixture for c in cell.circles}):
        circles = [c for c in cell.circles if c.fixture == fixture]
        with stages.stage("circles"):
            cell, arcs = _plan_arcs(cell, circles, options.seed, starts or {})
        with stages.stage("path"):
            drives.append(_join_circles(cell, fixture, arcs, sum(len(d.passes) for d in drives), options.seed))
    with stages.stage("programs"):
        bare = CircularPlan("0" * 12, cell, options.seed, tuple(drives))
        named = replace(bare, plan_id=circular_identity(bare))
        programs = assemble_programs(dialects, lambda dense: circle_program(named, dense))
        notes = (*_notes(named), *shared_notes(programs))
        return replace(named, programs=write_programs(cell, programs), notes=notes)


def _plan_arcs(
    cell: Cell, circles: Sequence[Circle], seed: int, starts: Mapping[str, Array]
) -> tuple[Cell, tuple[Arc, ...]]:
    """Plan all circles of one fixture; the first one's beginning is the mount pose, unless the cell has one."""
    arcs: list[Arc] = []
    for circle in circles:
        arc = plan_arc(cell, circle, seed, starts.get(circle.name, arcs[-1].q[0] if arcs else None))
        if cell.fixtures[circle.fixture].mount is None:
            mount = arc.q[0] if circle.directions[0] == "ccw" else arc.q[-1]
            fixtures = [replace(f, mount=mount) if k == circle.fixture else f for k, f in enumerate(cell.fixtures)]
            cell = replace(cell, fixtures=tuple(fixtures))
        arcs.append(arc)
    return cell, tuple(arcs)


def _join_circles(cell: Cell, fixture: int, arcs: tuple[Arc, ...], first: int, seed: int) -> CircularDrive:
    """Join the circles of one fixture into a session from mount pose to mount pose."""
    with_bar, without_bar = Constraints(cell, fixture), Constraints(cell, fixture, bar=False)
    mount = np.asarray(cell.fixtures[fixture].mount)
    travel = connect_poses(without_bar, np.vstack([cell.home, mount]), [0, 1], seed=seed)
    if isinstance(travel, PathGaps):
        name = cell.fixtures[fixture].name
        raise NoSolutionError(
            f"no collision-free way leads from home to where the bar is attached on fixture {name}: "
            f"{'; '.join(travel.reasons)}; lower motion.clearance_mm, or give another home_deg or gauge.mount_deg"
        )
    there = _release_way(without_bar, travel)
    passes: list[CircularPass] = []
    ways: dict[bytes, ReleasedPath] = {}
    here = mount
    for one in (*measured_passes(arcs, 2 * first), None):
        goal = mount if one is None else one.path.q[0]
        if np.abs(goal - here).max() > SAME_STATE:
            key = here.tobytes() + goal.tobytes()
            if key not in ways:
                ways[key] = _way_between(with_bar, here, goal, seed)
            passes.append(CircularPass.between(ways[key].path))
        if one is not None:
            passes.append(one)
            here = one.path.q[-1]
    verdicts = (*there.verdicts, *(v for w in ways.values() for v in w.verdicts))
    return CircularDrive(fixture, arcs, there.path, tuple(passes), verdicts)


def _way_between(constraints: Constraints, here: Array, goal: Array, seed: int) -> ReleasedPath:
    """The way with the bar on from one circle to the next."""
    path = connect_poses(constraints, np.vstack([here, goal]), [0, 1], seed=seed)
    if isinstance(path, PathGaps):
        raise NoSolutionError(
            f"no way with the bar on leads from one circle to the next: {'; '.join(path.reasons)}; measure them in "
            "cells of their own, or give tool_axis so that both are driven alike"
        )
    return _release_way(constraints, path)


def _release_way(constraints: Constraints, path: ProvenPath) -> ReleasedPath:
    return release_path(constraints, blend_way(constraints, replace(path, q=round_angles(path.q))))


def _notes(plan: CircularPlan) -> list[str]:
    cell, notes = plan.cell, load_notes(plan.cell)
    if not cell.robot.bodies:
        bare = "has no collision bodies: only bar and tool were checked against the surroundings"
        notes.append(f"{cell.robot.name} {bare}")
    for arc in (a for d in plan.drives for a in d.arcs):
        slowest = arc.slowest_on_sweep / arc.circle.speed
        if slowest < 0.99:
            notes.append(
                f"circle {arc.circle.name}: the tool has {100 * slowest:.0f} % of its speed where the sweep begins or "
                "at its slowest: a larger overshoot_deg, or a smaller speed_mm_s where an axis limits it, would help"
            )
    return notes
