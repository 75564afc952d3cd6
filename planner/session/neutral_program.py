"""The whole measuring session as a neutral program: travel, attach or prepare the gauge, measure, travel back."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.programs.dialect import PathForm, load_dialect
from planner.programs.instructions import (
    Centre,
    Comment,
    Dwell,
    Instruction,
    JointMove,
    LogAxes,
    Pause,
    Program,
    Section,
    StretchBegin,
    StretchEnd,
    Sync,
    WaitInput,
)
from planner.programs.program_files import write_checked
from planner.programs.rendering import ProgramFile
from planner.runs.run import Mounting
from planner.session.course import Course, TimedPath, rests_at_poses
from planner.session.driven_moves import circle_moves, degrees, dense_moves, joint_moves
from planner.session.emitted_speeds import check_emitted_speeds
from planner.session.plan_types import Programs
from planner.session.resumption import count_starts, cut_stretches


def session_program(cell: Cell, courses: Iterable[Course], plan_id: str, form: PathForm) -> Program:
    """Assemble the session as a controller wants it: small steps where it cannot blend, circles where it knows them."""
    if cell.controller.block_ms is not None:
        form = replace(form, block_s=cell.controller.block_ms / 1e3)
    body: list[Instruction] = []
    first = 1
    for one in courses:
        body += _course_instructions(cell, one, form, first)
        first += _count_starts(one)
    return build_program(cell, plan_id, body)


def _count_starts(course: Course) -> int:
    """Return at how many places of a course its session can be started: at poses, or at its beginning."""
    return count_starts(course.measuring) if course.is_of_poses else 1


def assemble_programs(dialects: Sequence[str], assemble: Callable[[PathForm], Program]) -> dict[str, Program]:
    """Return the neutral program for each dialect; ``assemble`` is told how the path is wanted."""
    forms = {name: load_dialect(name).path_form for name in dialects}
    forms = {name: form if form.dense else replace(form, block_s=PathForm.block_s) for name, form in forms.items()}
    made = {form: assemble(form) for form in dict.fromkeys(forms.values())}
    return {name: made[form] for name, form in forms.items()}


def write_programs(cell: Cell, programs: Mapping[str, Program]) -> Programs:
    """Write a session in each dialect; every program is read back and compared before it is returned."""
    stem = f"{cell.robot.name}_{cell.name.rpartition('/')[2]}"
    return tuple((name, write_session(cell, program, name, stem)) for name, program in programs.items())


def write_session(cell: Cell, program: Program, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write a session in one dialect; the text is read back, compared, and its speeds held against the limits.

    Raises:
        InputError: no such dialect, or it cannot carry the program.
        ProgramMismatchError: the text does something else, or drives tool or gauge beyond their limits.
    """
    files, found = write_checked(program, dialect, stem)
    check_emitted_speeds(cell, program, load_dialect(dialect), found)
    return files


def build_program(cell: Cell, plan_id: str, body: list[Instruction]) -> Program:
    """Return a session as a program: home first, then ``body``."""
    control = cell.controller
    return Program(
        plan_id=plan_id,
        robot=cell.robot.name,
        n_joints=cell.robot.n_joints,
        home_deg=degrees(cell.home),
        instructions=(Section("home"), move_home(cell), *body),
        tool=control.tool,
        base=control.base,
        load=control.load,
        sync_output=control.sync_output,
        gauge_input=control.gauge_input,
        map_mm=_mm(cell.tool.p_FM),
        mass_kg=cell.tool.mass,
        com_mm=_mm(cell.tool.com_F),
        part_lines=control.part_lines,
        block_ms=control.block_ms,
        joint_names=cell.robot.joint_names,
    )


def _course_instructions(cell: Cell, one: Course, form: PathForm, first: int) -> list[Instruction]:
    """The session of one mounting, from home and back home; ``first`` is the number of its first start."""
    cell = cell.at(one.mounting)
    bare, removal = cell.gauge.bare, cell.gauge.removal
    travel = joint_moves(cell, one.travel, None)
    there: list[Instruction] = [
        Section(f"to {one.start}{bare}"),
        *travel,
        *preparation(cell, one.mounting),
        WaitInput("gauge ready"),
    ]
    after = [Pause(removal)] if removal else []
    back: list[Instruction] = [*after, Section(f"back home{bare}"), *moves_back(travel, one.travel.q)]
    form = replace(form, dense=form.dense and not rests_at_poses(cell))
    last = StretchBegin(first + _count_starts(one) - 1)
    if not one.is_of_poses:
        passes = (item for p in _pass_instructions(cell, one, form) for item in (last, *p, StretchEnd()))
        return [last, *there, StretchEnd(), *passes, last, *back, StretchEnd()]
    path = one.measuring
    written = measured_moves(cell, path, one.mounting, form)
    measuring = cut_stretches(cell, one.mounting, _stop_short(cell, path), one.shortcuts, written, first)
    heading = Section(one.passes[0].heading)
    return [last, *there, StretchEnd(), heading, *measuring, last, *back, StretchEnd()]


def _pass_instructions(cell: Cell, course: Course, form: PathForm) -> Iterator[list[Instruction]]:
    """Yield every pass with its heading; where the load changes, the operator sets it."""
    written: dict[tuple[int, int], tuple[int, list[Instruction]]] = {}
    load: float | None = None
    for one in course.passes:
        out: list[Instruction] = []
        if one.load is not None and one.load != load:
            load = one.load
            out.append(Pause(f"set the load to {load:g} N"))
        out.append(Section(one.heading))
        key, number = (id(one.trajectory), id(one.path.q)), min(one.marks, default=0)
        if key not in written:  # a repeat is the same path with other marks
            written[key] = number, [item for _, item in measured_moves(cell, one.path, course.mounting, form)]
        first, moves = written[key]
        yield out + ([_shift_mark(item, number - first) for item in moves] if number != first else moves)


def _shift_mark(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item


def preparation(cell: Cell, mounting: Mounting) -> list[Instruction]:
    """Return what a person does with the gauge before the first pose is measured."""
    said, asked = cell.gauge.preparation(cell, mounting)
    return [*([Comment(said)] if said else []), Pause(asked)]


def moves_back(there: list[JointMove], q: Array) -> list[JointMove]:
    """The same legs the other way round: leg k back is leg −k−1 there, its corner the one before that."""
    blends = [0.0, *(m.blend_mm for m in there[:-1])]
    legs = zip(reversed(there), reversed(q[:-1]), reversed(blends), strict=True)
    return [replace(move, q_deg=degrees(target), blend_mm=blend, pose=None) for move, target, blend in legs]


def move_home(cell: Cell) -> JointMove:
    """The way to home is not planned: the operator stands the robot near it, and it moves slowly."""
    return JointMove(degrees(cell.home), duration_s=10.0, tool_speed_mm_s=50.0, axis_percent=5.0)


def measured_moves(cell: Cell, path: TimedPath, mounting: Mounting, form: PathForm) -> list[tuple[int, Instruction]]:
    """The measuring path with a mark at every pose; where the robot rests there, it settles and dwells.

    A ball is centred before the mark: the axes are logged where the centring led them.
    Each instruction with the number of the path's point at which the way to a pose begins, or −1.
    """
    out: list[tuple[int, Instruction]] = []
    if form.dense:
        out.append((-1, Comment("the blended path in small steps: every corner is already cut")))
        moves, begins = dense_moves(cell, path, mounting, form.block_s)
    else:
        rounds = circle_moves(cell, path, mounting) if form.circles else None
        moves = joint_moves(cell, path, mounting) if rounds is None else rounds
        begins = {k: k for k, move in enumerate(moves) if move.pose is not None}
    rests, short = rests_at_poses(cell) and not form.dense, _stop_short(cell, path)
    for k, move in enumerate(moves):
        asked = "" if move.pose is None else cell.gauge.seating(cell, np.deg2rad(move.q_deg), move.pose)
        out.append((begins.get(k, -1), replace(move, q_deg=degrees(short.q[k + 1])) if asked else move))
        if move.pose is None:
            continue
        mark, ball = _mark(cell, move.pose), cell.gauge.ball_to_centre(cell, np.deg2rad(move.q_deg))
        if ball is not None:
            mark = [Centre(ball + 1, move.pose), *mark]
        mark = [Pause(asked), *mark] if asked else mark
        mark = [Dwell(cell.motion.settle), *mark, Dwell(cell.motion.dwell)] if rests else mark
        out += [(-1, item) for item in mark]
    return out


def _stop_short(cell: Cell, path: TimedPath) -> TimedPath:
    """Return the path with poses as far before them as a person leads the tool."""
    before = np.vstack([path.q[:1], path.q[:-1]])
    share = cell.gauge.left_to_person * (path.visit >= 0)[:, None]
    return replace(path, q=path.q + share * (before - path.q))


def _mark(cell: Cell, pose: int) -> list[Instruction]:
    return [Sync(pose), LogAxes(pose)] if cell.controller.log_axes else [Sync(pose)]


def _mm(p: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v) * 1e3, 9) for v in p)
    return x, y, z
