"""A planned circular test read back from ``plan.json`` and the cell beside it: exported, simulated, evaluated later."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import read_cell
from planner.common.errors import InputError
from planner.common.units import MM, from_deg, read_only
from planner.instruments.circular.arc import circle_deviation, time_points
from planner.instruments.circular.plan import (
    Arc,
    ArcFile,
    CircularDrive,
    CircularPass,
    CircularPlan,
    CircularPlanFile,
    CircularSessionFile,
    measured_passes,
    read_circular_plan,
)
from planner.kinematics.bar_geometry import bar_state
from planner.runs.run import Samples
from planner.session.course import round_angles, time_path
from planner.session.document import read_waypoints

PAUSE = 5.0  # [s] between two passes
OFF = 1e-3 * MM  # by which the plan's points may miss its circles


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


def circle_samples(plan: CircularPlan, rate: float, ways: bool = True) -> Samples:
    """Where the arm is told to stand while the passes are driven, ``rate`` times a second; on the circles, or all."""
    parts, start = [], 0.0
    for drive in plan.drives:
        for one in (p for p in drive.passes if ways or p.arc is not None):
            motion = one.trajectory.sample(1.0 / rate)
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
            passes.append(CircularPass.between(time_path(cell, read_waypoints(one.way), bar=True)))
        else:
            passes.append(next(measured))
    travel = time_path(cell, read_waypoints(session.travel), bar=False)
    return CircularDrive(fixture, arcs, travel, tuple(passes))
