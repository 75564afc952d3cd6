"""The circular test as a neutral program: travel, attach, every circle in its directions and loads, detach, back.

The circles are driven as joint moves in small steps: what is printed is what was proven, in every dialect, and the
robot keeps its configuration. A controller's own CIRC would choose both by itself.
"""

from dataclasses import replace

from planner.cell.cell import Cell
from planner.common.units import to_mm
from planner.instruments.circular.plan import CircularDrive, CircularPass, CircularPlan
from planner.programs.instructions import Instruction, JointMove, LogAxes, Pause, Program, Section, Sync
from planner.session.neutral_program import BARE, build_program, dense_moves, from_home, measured_moves, with_bar


def circle_program(plan: CircularPlan, dense: bool) -> Program:
    """Assemble the test; ``dense`` is for controllers that blend only a path in small steps."""
    body: list[Instruction] = []
    for drive in plan.drives:
        body += _fixture_instructions(plan.cell, drive, dense)
    return build_program(plan.cell, plan.plan_id, body)


def _fixture_instructions(cell: Cell, drive: CircularDrive, dense: bool) -> list[Instruction]:
    heading = f"to the first circle about fixture {cell.fixtures[drive.fixture].name}, {BARE}"
    passes = with_bar(cell, drive.fixture, _pass_instructions(cell, drive, dense))
    return from_home(cell, drive.travel, heading, passes, f"back home, {BARE}")


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
        key = (id(one.trajectory), id(one.path.q))
        number = min(one.marks, default=0)
        if key not in written:
            moves = dense_moves(cell, one.path) if dense else measured_moves(cell, one.path)
            written[key] = number, moves
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


def _shift_mark(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item
