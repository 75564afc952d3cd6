"""A planned circular test read back from ``plan.json`` and the cell beside it: exported, simulated, evaluated later."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell import Cell
from planner.cell.reading import read_cell
from planner.circular import (
    Arc,
    CircularDrive,
    CircularPlan,
    Pass,
    measured_passes,
    off_circle,
    read_circular_plan,
    timed,
)
from planner.circular.file import ArcFile, CircularPlanFile, SessionFile
from planner.errors import InputError
from planner.gauge import bar_state
from planner.plan import WaypointFile, Waypoints, settled
from planner.program import ProgramFile, info, write_program
from planner.repeatable import single_threaded
from planner.run import Samples
from planner.simulation import RATE, SimulatedRun, drawn, read_truth, simulate
from planner.units import MM, Array, from_deg, frozen
from planner.workflow.circle_session import circle_session
from planner.workflow.circle_ways import timed_way

PAUSE = 5.0  # [s] between two passes
OFF = 1e-3 * MM  # by which the plan's points may miss its circles


@single_threaded
def export_circles(path: Path, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write the program of the circular test at ``path`` in ``dialect``; ``stem`` is the file name, ``-`` for none.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together; an unknown dialect.
    """
    plan = planned_circles(path)
    name = f"{plan.cell.robot.name}_{plan.plan_id}" if stem == "-" else Path(stem).stem
    return write_program(circle_session(plan, info(dialect).wants_dense_path), dialect, name)


@single_threaded
def simulate_circles(path: Path, truth: Path | None, seed: int) -> SimulatedRun:
    """Simulate the measured run of the circular test at ``path``; errors are drawn where no ``truth`` is given.

    Raises:
        InputError: no plan, no cell beside it, the two do not belong together, or a truth that is wrong.
    """
    plan = planned_circles(path)
    samples = circle_samples(plan)
    known = drawn(plan.cell, seed) if truth is None else read_truth(truth, plan.cell, samples)
    return simulate(plan.cell, plan.plan_id, samples, known, seed)


def planned_circles(path: Path) -> CircularPlan:
    """Read a circular test with the cell beside it, as it is driven.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together.
    """
    file = read_circular_plan(path)
    cell = circular_cell(path, file)
    cell = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
    arcs = [_arc(path, cell, c) for c in file.circles]
    drives: list[CircularDrive] = []
    for session in file.sessions:
        fixture = [f.name for f in cell.fixtures].index(session.fixture)
        mine = tuple(a for a in arcs if a.circle.fixture == fixture)
        drives.append(_drive(cell, fixture, mine, session, 2 * sum(len(d.passes) for d in drives)))
    return CircularPlan(file.plan_id, cell, file.seed, tuple(drives))


def circular_cell(path: Path, plan: CircularPlanFile) -> Cell:
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
            motion = one.trajectory.sample(1.0 / RATE)
            load = np.full(len(motion.t), 0.0 if one.load is None else one.load)
            place = np.full(len(motion.t), drive.fixture)
            parts.append((motion.t + start, motion.q, motion.dq, load, place))
            start += one.trajectory.duration_s + PAUSE
    t, q, speed, load, place = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Samples(
        q=frozen(q),
        place=place,
        t=frozen(t),
        session=np.zeros(len(t), dtype=int),
        force=frozen(load) if load.any() else None,
        speed=frozen(speed),
    )


def _arc(path: Path, cell: Cell, file: ArcFile) -> Arc:
    circle = next(c for c in cell.circles if c.name == file.name)
    if any(len(q) != cell.robot.n_joints for q in file.q_deg) or len(file.q_deg) != len(file.angle_deg):
        raise InputError(f"{path}: circle {file.name} needs {cell.robot.n_joints} joint angles at every angle")
    q, angle = settled(np.deg2rad(file.q_deg)), frozen(from_deg(file.angle_deg))
    x = cell.map_position(q)
    off = float(np.abs(x - circle.points(angle)).max())
    if off > OFF:
        raise InputError(
            f"{path}: the tool misses circle {file.name} of {path.parent / 'cell.toml'} by {off / MM:.3f} mm: "
            "robot, tool or circle is not that of the plan; use the cell.toml that was written with it, or plan again"
        )
    blend, length = file.blend_mm * MM, bar_state(x, cell.fixtures[circle.fixture].p_BX).length
    there, back = (timed(cell, points, circle.speed, blend) for points in (q, q[::-1]))
    return Arc(circle, angle, q, frozen(length), off_circle(cell, circle, there), blend, there, back)


def _drive(cell: Cell, fixture: int, arcs: tuple[Arc, ...], session: SessionFile, number: int) -> CircularDrive:
    measured = measured_passes(arcs, number)
    passes = []
    for one in session.passes:
        if one.way:
            points = _waypoints(one.way)
            passes.append(Pass.between(points, timed_way(cell, points, bar=True)))
        else:
            passes.append(next(measured))
    way = _waypoints(session.travel)
    return CircularDrive(fixture, arcs, way, timed_way(cell, way, bar=False), tuple(passes))


def _waypoints(points: Sequence[WaypointFile]) -> Waypoints:
    blend: Array = np.round(np.array([p.blend_mm for p in points]) / 1e3, 12)
    return Waypoints(settled(np.deg2rad([p.q_deg for p in points])), np.array([p.visit for p in points]), blend)
