"""``edbb plan`` of a cell with ``[[circles]]``: from the circles to the programs of a circular test."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell import Cell, Circle
from planner.circular import Arc, CircularDrive, CircularPlan, Pass, circular_identity, measured_passes, plan_arc
from planner.circular.loads import check_loads, load_notes
from planner.errors import InputError, NoSolutionError
from planner.path import Constraints, Gaps, join
from planner.plan import settled
from planner.program import Program, info, program_notes, write_program
from planner.repeatable import single_threaded
from planner.units import Array
from planner.workflow.circle_session import circle_session
from planner.workflow.circle_ways import Way, proven_way
from planner.workflow.mount import check_home
from planner.workflow.planning import Options, Stages

SAME = 1e-6  # [rad] a state in which the arm already stands


@single_threaded
def plan_circles(
    cell: Cell, options: Options, stages: Stages, starts: Mapping[str, Array] | None = None
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
            cell, arcs = _arcs(cell, circles, options.seed, starts or {})
        with stages.stage("path"):
            drives.append(_drive(cell, fixture, arcs, sum(len(d.passes) for d in drives), options.seed))
    with stages.stage("programs"):
        bare = CircularPlan("0" * 12, cell, options.seed, tuple(drives))
        named = replace(bare, plan_id=circular_identity(bare))
        written = {
            dense: circle_session(named, dense) for dense in sorted({info(n).wants_dense_path for n in dialects})
        }
        texts = {n: written[info(n).wants_dense_path] for n in dialects}
        stem = f"{cell.robot.name}_{cell.name.rpartition('/')[2]}"
        programs = tuple((n, write_program(program, n, stem)) for n, program in texts.items())
        return replace(named, programs=programs, notes=(*_notes(named), *_program_notes(texts)))


def _arcs(
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


def _drive(cell: Cell, fixture: int, arcs: tuple[Arc, ...], first: int, seed: int) -> CircularDrive:
    """Join the circles of one fixture into a session from mount pose to mount pose."""
    with_bar, without_bar = Constraints(cell, fixture), Constraints(cell, fixture, bar=False)
    mount = np.asarray(cell.fixtures[fixture].mount)
    travel = join(without_bar, np.vstack([cell.home, mount]), [0, 1], seed=seed)
    if isinstance(travel, Gaps):
        name = cell.fixtures[fixture].name
        raise NoSolutionError(
            f"no collision-free way leads from home to where the bar is attached on fixture {name}: "
            f"{'; '.join(travel.reasons)}; lower motion.clearance_mm, or give another home_deg or gauge.mount_deg"
        )
    there = proven_way(without_bar, replace(travel, q=settled(travel.q)))
    passes: list[Pass] = []
    ways: dict[bytes, Way] = {}
    here = mount
    for one in (*measured_passes(arcs, 2 * first), None):
        goal = mount if one is None else one.points.q[0]
        if np.abs(goal - here).max() > SAME:
            key = here.tobytes() + goal.tobytes()
            if key not in ways:
                ways[key] = _between(with_bar, here, goal, seed)
            passes.append(Pass.between(ways[key].points, ways[key].trajectory))
        if one is not None:
            passes.append(one)
            here = one.points.q[-1]
    verdicts = (*there.verdicts, *(v for w in ways.values() for v in w.verdicts))
    return CircularDrive(fixture, arcs, there.points, there.trajectory, tuple(passes), verdicts)


def _between(constraints: Constraints, here: Array, goal: Array, seed: int) -> Way:
    """The way with the bar on from one circle to the next."""
    path = join(constraints, np.vstack([here, goal]), [0, 1], seed=seed)
    if isinstance(path, Gaps):
        raise NoSolutionError(
            f"no way with the bar on leads from one circle to the next: {'; '.join(path.reasons)}; measure them in "
            "cells of their own, or give tool_axis so that both are driven alike"
        )
    return proven_way(constraints, replace(path, q=settled(path.q)))


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


def _program_notes(texts: Mapping[str, Program]) -> list[str]:
    said: dict[str, list[str]] = {}
    for name, program in texts.items():
        for text in program_notes(program, name):
            said.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in said.items()]
