"""What is made later of ``plan.json`` and the cell beside it: programs in any dialect, and simulated runs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import read_cell
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError
from planner.common.units import MM, Array, from_deg, read_only
from planner.instruments.circular.arc import circle_deviation, time_points
from planner.instruments.circular.plan import (
    Arc,
    ArcFile,
    CircularDrive,
    CircularPass,
    CircularPlan,
    CircularPlanFile,
    CircularSessionFile,
    is_circular,
    measured_passes,
    read_circular_plan,
)
from planner.kinematics.bar_geometry import bar_state
from planner.programs.program_files import dialect_info, write_program
from planner.programs.rendering import ProgramFile
from planner.runs.run import Samples
from planner.session.course import Course, Waypoints, round_angles, time_course
from planner.session.neutral_program import session_program
from planner.session.plan_consistency import check_courses, check_robot, place_names
from planner.session.plan_file import DriveFile, WaypointFile, read_plan
from planner.simulation.measurement import SAMPLE_RATE, SimulatedRun, planned_samples, simulate, warn_uncentred_balls
from planner.simulation.truth import draw_truth, read_truth
from planner.workflow.circle_planning import circle_program, time_way

PAUSE = 5.0  # [s] between two passes
OFF = 1e-3 * MM  # by which the plan's points may miss its circles


@on_one_thread
def export_circles(path: Path, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write the program of the circular test at ``path`` in ``dialect``; ``stem`` is the file name, ``-`` for none.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together; an unknown dialect.
    """
    plan = load_circular_plan(path)
    name = f"{plan.cell.robot.name}_{plan.plan_id}" if stem == "-" else Path(stem).stem
    return write_program(circle_program(plan, dialect_info(dialect).wants_dense_path), dialect, name)


@on_one_thread
def simulate_circles(path: Path, truth: Path | None, seed: int) -> SimulatedRun:
    """Simulate the measured run of the circular test at ``path``; errors are drawn where no ``truth`` is given.

    Raises:
        InputError: no plan, no cell beside it, the two do not belong together, or a truth that is wrong.
    """
    plan = load_circular_plan(path)
    samples = circle_samples(plan)
    known = draw_truth(plan.cell, seed) if truth is None else read_truth(truth, plan.cell, samples)
    return simulate(plan.cell, plan.plan_id, samples, known, seed)


def load_circular_plan(path: Path) -> CircularPlan:
    """Read a circular test with the cell beside it, as it is driven.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together.
    """
    file = read_circular_plan(path)
    cell = load_circular_cell(path, file)
    cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
    arcs = [_arc(path, cell, c) for c in file.circles]
    drives: list[CircularDrive] = []
    for session in file.sessions:
        fixture = [f.name for f in cell.fixtures].index(session.fixture)
        mine = tuple(a for a in arcs if a.circle.fixture == fixture)
        drives.append(_drive(cell, fixture, mine, session, 2 * sum(len(d.passes) for d in drives)))
    return CircularPlan(file.plan_id, cell, file.seed, tuple(drives))


def load_circular_cell(path: Path, plan: CircularPlanFile) -> Cell:
    """Read the cell beside a plan.

    Raises:
        InputError: it is not there, or it is not that of the plan.
    """
    beside = path.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a circular test is read together with the cell that was planned")
    cell = read_cell(beside, "cell")
    wanted, there = [c.name for c in plan.circles], [c.name for c in cell.circles]
    fixtures = {s.fixture for s in plan.sessions} <= {f.name for f in cell.fixtures}
    if cell.robot.name != plan.robot or sorted(wanted) != sorted(there) or not fixtures:
        raise InputError(
            f"{path} is a plan of the circles {', '.join(wanted)} for {plan.robot}, {beside} a cell of "
            f"{cell.robot.name} with {', '.join(there) or 'no circles'}: put the cell.toml of the plan there"
        )
    return cell


def circle_samples(plan: CircularPlan, ways: bool = True) -> Samples:
    """Where the arm is told to stand while the passes are driven, ``RATE`` times a second; on the circles, or all."""
    parts, start = [], 0.0
    for drive in plan.drives:
        for one in (p for p in drive.passes if ways or p.arc is not None):
            motion = one.trajectory.sample(1.0 / SAMPLE_RATE)
            load = np.full(len(motion.t), 0.0 if one.load is None else one.load)
            place = np.full(len(motion.t), drive.fixture)
            parts.append((motion.t + start, motion.q, motion.dq, load, place))
            start += one.trajectory.duration_s + PAUSE
    t, q, speed, load, place = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Samples(
        q=read_only(q),
        place=place,
        t=read_only(t),
        session=np.zeros(len(t), dtype=int),
        force=read_only(load) if load.any() else None,
        speed=read_only(speed),
    )


def _arc(path: Path, cell: Cell, file: ArcFile) -> Arc:
    circle = next(c for c in cell.circles if c.name == file.name)
    if any(len(q) != cell.robot.n_joints for q in file.q_deg) or len(file.q_deg) != len(file.angle_deg):
        raise InputError(f"{path}: circle {file.name} needs {cell.robot.n_joints} joint angles at every angle")
    q, angle = round_angles(np.deg2rad(file.q_deg)), read_only(from_deg(file.angle_deg))
    x = cell.map_position(q)
    off = float(np.abs(x - circle.points(angle)).max())
    if off > OFF:
        raise InputError(
            f"{path}: the tool misses circle {file.name} of {path.parent / 'cell.toml'} by {off / MM:.3f} mm: "
            "robot, tool or circle is not that of the plan; use the cell.toml that was written with it, or plan again"
        )
    blend, length = file.blend_mm * MM, bar_state(x, cell.fixtures[circle.fixture].p_BX).length
    there, back = (time_points(cell, points, circle.speed, blend) for points in (q, q[::-1]))
    return Arc(circle, angle, q, read_only(length), circle_deviation(cell, circle, there), blend, there, back)


def _drive(cell: Cell, fixture: int, arcs: tuple[Arc, ...], session: CircularSessionFile, number: int) -> CircularDrive:
    measured = measured_passes(arcs, number)
    passes = []
    for one in session.passes:
        if one.way:
            points = _waypoints(one.way)
            passes.append(CircularPass.between(points, time_way(cell, points, bar=True)))
        else:
            passes.append(next(measured))
    way = _waypoints(session.travel)
    return CircularDrive(fixture, arcs, way, time_way(cell, way, bar=False), tuple(passes))


def _waypoints(points: Sequence[WaypointFile]) -> Waypoints:
    blend: Array = np.round(np.array([p.blend_mm for p in points]) / 1e3, 12)
    return Waypoints(round_angles(np.deg2rad([p.q_deg for p in points])), np.array([p.visit for p in points]), blend)


@on_one_thread
def export_plan(path: Path, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write the program of the plan at ``path`` in ``dialect``; ``stem`` is the wanted file name, ``-`` for none.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together; an unknown dialect.
    """
    if is_circular(path):
        return export_circles(path, dialect, stem)
    chosen = dialect_info(dialect)
    file = read_plan(path)
    beside = path.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a plan is exported together with the cell that was planned")
    cell = read_cell(beside, "cell")
    planned_for = check_robot(path, beside, cell, file)
    courses = [course_from_file(path, cell, d) for d in file.drives]
    check_courses(path, beside, cell, planned_for, courses)
    program = session_program(cell, courses, file.plan_id, chosen.wants_dense_path)
    name = f"{cell.robot.name}_{file.plan_id}" if stem == "-" else Path(stem).stem
    return write_program(program, dialect, name)


def course_from_file(path: Path, cell: Cell, drive: DriveFile) -> Course:
    """Return one drive of a plan file, timed as the cell says."""
    fixture = place_names(cell).index((drive.fixture, drive.point))
    return time_course(
        cell, fixture, _waypoints_from_file(path, cell, drive.travel), _waypoints_from_file(path, cell, drive.waypoints)
    )


def _waypoints_from_file(path: Path, cell: Cell, points: tuple[WaypointFile, ...]) -> Waypoints:
    wrong = [len(p.q_deg) for p in points if len(p.q_deg) != cell.robot.n_joints]
    if wrong or len(points) < 2:
        found = f"{wrong[0]} angles" if wrong else f"{len(points)} waypoints"
        raise InputError(
            f"{path}: a drive has {found}; {cell.robot.name} needs {cell.robot.n_joints} angles and two waypoints"
        )
    return Waypoints(
        round_angles(np.deg2rad([p.q_deg for p in points])),
        np.array([p.visit for p in points]),
        np.round(np.array([p.blend_mm for p in points]) / 1e3, 12),
    )


@on_one_thread
def simulate_plan(plan_file: Path, truth: Path | None, seed: int) -> SimulatedRun:
    """Simulate the measured run of the plan at ``plan_file``; errors are drawn where no ``truth`` is given.

    A smoke test of the chain, as planner and identifier share its model; the run carries what is true.

    Raises:
        InputError: no plan, no cell beside it, the two do not belong together, or a truth that is wrong.
    """
    if is_circular(plan_file):
        return simulate_circles(plan_file, truth, seed)
    plan = read_plan(plan_file)
    beside = plan_file.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a plan is simulated together with the cell that was planned")
    cell = read_cell(beside, "cell")
    samples = planned_samples(cell, plan, [course_from_file(plan_file, cell, d) for d in plan.drives])
    known = draw_truth(cell, seed) if truth is None else read_truth(truth, cell, samples)
    return warn_uncentred_balls(cell, simulate(cell, plan.plan_id, samples, known, seed), samples)
