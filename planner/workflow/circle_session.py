"""The circular test as a neutral program: travel, attach, every circle in its directions and loads, detach, back.

The circles are driven as joint moves in small steps: what is printed is what was proven, in every dialect, and the
robot keeps its configuration. A controller's own CIRC would choose both by itself.
"""

from dataclasses import replace

from planner.cell import Cell
from planner.circular import CircularDrive, CircularPlan, Pass
from planner.plan import Course
from planner.program import Instruction, JointMove, LogAxes, Pause, Program, Section, Sync, WaitInput
from planner.units import to_mm
from planner.workflow.session import dense_moves, joint_moves, measured_moves, program_of, way_back


def circle_session(plan: CircularPlan, dense: bool) -> Program:
    """Assemble the test; ``dense`` is for controllers that blend only a path in small steps."""
    body: list[Instruction] = []
    for drive in plan.drives:
        body += _of_fixture(plan.cell, drive, dense)
    return program_of(plan.cell, plan.plan_id, body)


def _of_fixture(cell: Cell, drive: CircularDrive, dense: bool) -> list[Instruction]:
    name = cell.fixtures[drive.fixture].name
    there = joint_moves(cell, drive.way, drive.way_trajectory, bar=False)
    return [
        Section(f"to the first circle about fixture {name}, without the bar"),
        *there,
        Pause(f"attach the bar (fixture {name} to tool), set its zero"),
        WaitInput("gauge ready"),
        *_passes(cell, drive, dense),
        Pause("take the bar off"),
        Section("back home, without the bar"),
        *way_back(there, drive.way.q),
    ]


def _passes(cell: Cell, drive: CircularDrive, dense: bool) -> list[Instruction]:
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
            written[key] = number, _moves(cell, drive, one, dense)
        first, moves = written[key]
        out += [_marked(item, number - first) for item in moves]
    return out


def _heading(drive: CircularDrive, one: Pass, last: bool) -> str:
    if one.arc is None:
        return "back to where the bar is taken off" if last else "to the next circle"
    circle = drive.arcs[one.arc].circle
    load = "" if one.load is None else f", {one.load:g} N"
    repeat = "" if circle.repeats == 1 else f", repeat {one.repeat + 1} of {circle.repeats}"
    return f"circle {circle.name} in {circle.plane}, radius {to_mm(circle.radius):g} mm, {one.direction}{load}{repeat}"


def _moves(cell: Cell, drive: CircularDrive, one: Pass, dense: bool) -> list[Instruction]:
    course = Course(drive.fixture, drive.way, drive.way_trajectory, one.points, one.trajectory)
    return dense_moves(cell, course) if dense else measured_moves(cell, course)


def _marked(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item
