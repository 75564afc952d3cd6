"""Circular tests: from the ``[[circles]]`` of a cell to proven, timed passes and their programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.circles import Circle
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array, to_mm
from planner.instruments.circular.arc import check_loads, load_notes, plan_arc
from planner.instruments.circular.plan import (
    Arc,
    CircularDrive,
    CircularPass,
    CircularPlan,
    circular_identity,
    measured_passes,
)
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathGaps, ProvenPath, Verdict, judge_path
from planner.motion.timing.trajectory import Trajectory, plan_trajectory
from planner.programs.instructions import Instruction, JointMove, LogAxes, Pause, Program, Section, Sync, WaitInput
from planner.programs.program_files import dialect_info, program_notes, write_program
from planner.session.bar_planning import PlanOptions, Stages
from planner.session.course import Course, Waypoints, add_blends, axis_limits, round_angles, tool_speed
from planner.session.mount import check_home
from planner.session.neutral_program import build_program, dense_moves, joint_moves, measured_moves, moves_back


@dataclass(frozen=True)
class TimedWay:
    """A path with its blends, in time, and what both engines say of it."""

    points: Waypoints
    trajectory: Trajectory
    verdicts: tuple[Verdict, ...]


def prove_way(constraints: Constraints, path: ProvenPath) -> TimedWay:
    """Blend, time and judge a path; blends that an engine does not prove become stops.

    Raises:
        NoSolutionError: an engine does not prove the path at all.
    """
    none = np.zeros(len(path.q), dtype=bool)
    points = add_blends(constraints.cell, constraints, path, none, np.full(len(path.q), -1))
    for attempt in (points, replace(points, blend=np.zeros(len(path.q)))):
        way = _judge_way(constraints, attempt)
        if all(v.clear for v in way.verdicts):
            return way
    bad = [f"{v.engine}: {f}" for v in way.verdicts for f in v.failures]
    raise NoSolutionError(f"path: {bad[0]} is not proven: raise motion.clearance_mm a little, or try another --seed")


def _judge_way(constraints: Constraints, points: Waypoints) -> TimedWay:
    trajectory = time_way(constraints.cell, points, constraints.bar)
    corner = np.flatnonzero(~trajectory.stop)
    triangles = np.stack([trajectory.entry[corner], points.q[corner], trajectory.exit[corner]], axis=1)
    return TimedWay(points, trajectory, judge_path(constraints, points.q, triangles))


def time_way(cell: Cell, points: Waypoints, bar: bool) -> Trajectory:
    """Time a way with or without the bar."""
    return plan_trajectory(
        points.q,
        stop=points.blend == 0,
        blend_m=points.blend,
        tool_position=cell.map_position,
        tool_jacobian=cell.map_jacobian,
        limits=axis_limits(cell, bar),
        tool_speed=tool_speed(cell, bar),
    )


def circle_program(plan: CircularPlan, dense: bool) -> Program:
    """Assemble the test; ``dense`` is for controllers that blend only a path in small steps."""
    body: list[Instruction] = []
    for drive in plan.drives:
        body += _fixture_instructions(plan.cell, drive, dense)
    return build_program(plan.cell, plan.plan_id, body)


def _fixture_instructions(cell: Cell, drive: CircularDrive, dense: bool) -> list[Instruction]:
    name = cell.fixtures[drive.fixture].name
    there = joint_moves(cell, drive.way, drive.way_trajectory, bar=False)
    return [
        Section(f"to the first circle about fixture {name}, without the bar"),
        *there,
        Pause(f"attach the bar (fixture {name} to tool), set its zero"),
        WaitInput("gauge ready"),
        *_pass_instructions(cell, drive, dense),
        Pause("take the bar off"),
        Section("back home, without the bar"),
        *moves_back(there, drive.way.q),
    ]


def _pass_instructions(cell: Cell, drive: CircularDrive, dense: bool) -> list[Instruction]:
    """Every pass with its heading; where the load changes, the operator sets it."""
    out: list[Instruction] = []
    written: dict[tuple[int, int], tuple[int, list[Instruction]]] = {}
    load: float | None = None
    for one in drive.passes:
        if one.load is not None and one.load != load:
            load = one.load
            out.append(Pause(f"set the load to {load:g} N"))
        out.append(Section(_heading(drive, one, last=one is drive.passes[-1])))
        key = (id(one.trajectory), id(one.points.q))
        number = min(one.marks, default=0)
        if key not in written:
            written[key] = number, _pass_moves(cell, drive, one, dense)
        first, moves = written[key]
        out += [_shift_mark(item, number - first) for item in moves]
    return out


def _heading(drive: CircularDrive, one: CircularPass, last: bool) -> str:
    if one.arc is None:
        return "back to where the bar is taken off" if last else "to the next circle"
    circle = drive.arcs[one.arc].circle
    load = "" if one.load is None else f", {one.load:g} N"
    repeat = "" if circle.repeats == 1 else f", repeat {one.repeat + 1} of {circle.repeats}"
    return f"circle {circle.name} in {circle.plane}, radius {to_mm(circle.radius):g} mm, {one.direction}{load}{repeat}"


def _pass_moves(cell: Cell, drive: CircularDrive, one: CircularPass, dense: bool) -> list[Instruction]:
    course = Course(drive.fixture, drive.way, drive.way_trajectory, one.points, one.trajectory)
    return dense_moves(cell, course) if dense else measured_moves(cell, course)


def _shift_mark(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item


SAME = 1e-6  # [rad] a state in which the arm already stands


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
        written = {
            dense: circle_program(named, dense)
            for dense in sorted({dialect_info(n).wants_dense_path for n in dialects})
        }
        texts = {n: written[dialect_info(n).wants_dense_path] for n in dialects}
        stem = f"{cell.robot.name}_{cell.name.rpartition('/')[2]}"
        programs = tuple((n, write_program(program, n, stem)) for n, program in texts.items())
        return replace(named, programs=programs, notes=(*_notes(named), *_program_notes(texts)))


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
    there = prove_way(without_bar, replace(travel, q=round_angles(travel.q)))
    passes: list[CircularPass] = []
    ways: dict[bytes, TimedWay] = {}
    here = mount
    for one in (*measured_passes(arcs, 2 * first), None):
        goal = mount if one is None else one.points.q[0]
        if np.abs(goal - here).max() > SAME:
            key = here.tobytes() + goal.tobytes()
            if key not in ways:
                ways[key] = _way_between(with_bar, here, goal, seed)
            passes.append(CircularPass.between(ways[key].points, ways[key].trajectory))
        if one is not None:
            passes.append(one)
            here = one.points.q[-1]
    verdicts = (*there.verdicts, *(v for w in ways.values() for v in w.verdicts))
    return CircularDrive(fixture, arcs, there.points, there.trajectory, tuple(passes), verdicts)


def _way_between(constraints: Constraints, here: Array, goal: Array, seed: int) -> TimedWay:
    """The way with the bar on from one circle to the next."""
    path = connect_poses(constraints, np.vstack([here, goal]), [0, 1], seed=seed)
    if isinstance(path, PathGaps):
        raise NoSolutionError(
            f"no way with the bar on leads from one circle to the next: {'; '.join(path.reasons)}; measure them in "
            "cells of their own, or give tool_axis so that both are driven alike"
        )
    return prove_way(constraints, replace(path, q=round_angles(path.q)))


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
