"""The whole measuring session as a neutral program: travel, attach or prepare the gauge, measure, travel back."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.units import Array, to_mm
from planner.kinematics.axes import AxisConvention
from planner.kinematics.geometry import points_on_arc
from planner.motion.collision.surroundings import describe_parked_joints, describe_unchecked_links
from planner.motion.timing.leg_times import tool_positions, travel_and_length_change
from planner.programs.controller_axes import axis_convention, check_model_angles, in_controller_axes
from planner.programs.coupled_axes import coupling_checks
from planner.programs.dialect import Dialect, PathForm, load_dialect
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
from planner.programs.languages.execution import ReadBack
from planner.programs.rendering import ProgramFile, axis_names
from planner.programs.verification import write_and_read_back
from planner.runs.run import Mounting
from planner.session.driven_motion import unreleased_error
from planner.session.driven_moves import circle_moves, degrees, dense_moves, joint_moves
from planner.session.judgement import judge_program
from planner.session.plan_types import Course, Programs, TimedPath
from planner.session.tolerances import EMITTED_SPEED_RATIO, PRINTED_TRAVEL
from planner.session.tour_cost import cut_stretches

LEG_PIECES = 32  # of a leg, whose chords give the largest speed on it


def check_emitted_speeds(cell: Cell, program: Program, axes: AxisConvention, dialect: Dialect, found: ReadBack) -> None:
    """Refuse a program on any leg of which tool or gauge would exceed its speed limit.

    ``program`` is in the joints of the model, ``found`` what was read back of its text, in the controller's ``axes``.
    The joints are taken to move evenly over the time that the speed words give the leg, faster by the peak over the
    mean speed where the program itself says how the joints speed up, and the tool evenly round a circle. A speed word
    of the tool is that of the tool.

    Raises:
        NoSolutionError: naming the move, the speed and the limit.
    """
    limited = [k for k, m in enumerate(program.moves) if np.isfinite(m.tool_limit_mm_s)]
    c = np.deg2rad(np.vstack([axes.degrees_to_controller(program.home_deg), found.joint_path_deg]))
    q = axes.to_model(c)
    speeds = np.array([m.speed / m.peak for m in found.moves])
    circles = {k: axes.to_model(np.deg2rad(m.via_deg)) for k, m in enumerate(found.moves) if m.via_deg is not None}
    for mounting in sorted({program.moves[k].mounting for k in limited}, key=str):
        rows = np.array([k for k in limited if k > 0 and program.moves[k].mounting == mounting], dtype=int)
        if not len(rows):
            continue
        x = _tool_points(cell, q, rows, circles, mounting)
        travel, change = (part.max(axis=0) * LEG_PIECES for part in travel_and_length_change(cell, mounting, x))
        seconds = _leg_seconds(axes, dialect, c, speeds, rows, travel)
        round_legs = np.isin(rows, list(circles))
        seconds[round_legs] = travel[round_legs] / (speeds[rows[round_legs]] / 1e3)
        limit = np.array([program.moves[k].tool_limit_mm_s for k in rows]) / 1e3
        _refuse(rows, travel, seconds, limit, "the tool")
        if mounting is not None and np.isfinite(cell.gauge.rate):
            _refuse(rows, change, seconds, np.full(len(rows), cell.gauge.rate), "the gauge")


def _tool_points(
    cell: Cell, q: Array, rows: np.ndarray, circles: Mapping[int, Array], mounting: Mounting | None
) -> Array:
    """Return the tool points at equal shares of the legs ``rows`` of q (n + 1, N) [rad], (LEG_PIECES + 1, m, 3) [m]."""
    x = tool_positions(cell, mounting, q[rows], q[rows + 1], LEG_PIECES)
    at = cell if mounting is None else cell.at(mounting)
    for i, k in enumerate(rows):
        if k in circles:
            ends = at.map_position(np.stack([q[k], circles[k], q[k + 1]]))
            x[:, i] = points_on_arc(ends, np.linspace(0.0, 1.0, LEG_PIECES + 1))[0]
    return x


def _leg_seconds(
    axes: AxisConvention, dialect: Dialect, c: Array, speeds: Array, rows: np.ndarray, travel: Array
) -> Array:
    """Time that the speed words give each leg of the controller's axes c (n + 1, N) [rad], (m,) [s]."""
    said, leg = speeds[rows], np.abs(c[rows + 1] - c[rows])
    match dialect.speed.kind:
        case "axis_percent":
            quickest = (leg / axes.speed).max(axis=1)
            return np.asarray(quickest / (said / 100.0))
        case "inverse_time":
            return np.asarray(60.0 / said)
        case "duration":
            return np.asarray(said)
        case "leading_axis":
            return np.asarray(np.rad2deg(leg).max(axis=1) / said)
        case "tool_speed":
            per_second = said / (60.0 if dialect.speed.unit == "mm/min" else 1.0) / 1e3
            return np.asarray(travel / per_second)


def _refuse(rows: np.ndarray, travel: Array, seconds: Array, limit: Array, what: str) -> None:
    speed = np.maximum(travel - PRINTED_TRAVEL, 0.0) / np.maximum(seconds, 1e-9)
    over = np.flatnonzero(speed > limit * EMITTED_SPEED_RATIO)
    if len(over):
        k = int(over[np.argmax(speed[over] / limit[over])])
        raise unreleased_error(
            f"move {rows[k] + 1} drives {what} at {to_mm(speed[k]):.2f} mm/s, allowed are {to_mm(limit[k]):.2f} mm/s"
        )


def session_program(cell: Cell, courses: Iterable[Course], plan_id: str, form: PathForm) -> Program:
    """Assemble the session as a controller wants it: small steps where it cannot blend, circles where it knows them."""
    if cell.controller.block_ms is not None:
        form = replace(form, block_s=cell.controller.block_ms / 1e3)
    body: list[Instruction] = []
    first, courses = 1, tuple(courses)
    last_pose = max((int(v) for c in courses for p in c.passes for v in p.path.visit), default=0)
    for one in courses:
        body += _course_instructions(cell, one, form, first, last_pose)
        first += _count_starts(one)
    return build_program(cell, plan_id, body)


def _count_starts(course: Course) -> int:
    """Return at how many places of a course its session can be started: at poses, or at its beginning."""
    return int((course.measuring.visit[1:] >= 0).sum()) if course.is_of_poses else 1


def assemble_programs(dialects: Sequence[str], assemble: Callable[[PathForm], Program]) -> dict[str, Program]:
    """Return the neutral program for each dialect; ``assemble`` is told how the path is wanted."""
    forms = {name: driven_form(name) for name in dialects}
    made = {form: assemble(form) for form in dict.fromkeys(forms.values())}
    return {name: made[form] for name, form in forms.items()}


def driven_form(dialect: str) -> PathForm:
    """Return how the path of a session is wanted by a dialect: dialects of one form drive the same.

    Raises:
        InputError: no such dialect.
    """
    form = load_dialect(dialect).path_form
    return form if form.dense else replace(form, block_s=PathForm.block_s)


def write_programs(cell: Cell, programs: Mapping[str, Program]) -> Programs:
    """Write a session in each dialect; every program is proven, and read back and compared before it is returned.

    Raises:
        NoSolutionError: a motion of a program is not proven.
    """
    for program in {id(p): p for p in programs.values()}.values():
        judge_program(cell, program)
    stem = f"{cell.robot.name}_{cell.name.rpartition('/')[2]}"
    return tuple((name, write_session(cell, program, name, stem)) for name, program in programs.items())


def write_session(cell: Cell, program: Program, dialect: str, stem: str) -> tuple[ProgramFile, ...]:
    """Write a session in one dialect, in the axes of its controller; the text is read back, compared, and its speeds
    held against the limits.

    Raises:
        InputError: no such dialect, it cannot carry the program, or the robot's file does not say how its axes count.
        NoSolutionError: a move leaves the stroke of one of the controller's axes, or drives tool or gauge beyond their
            limits.
        ProgramMismatchError: the text does something else.
    """
    language, robot = load_dialect(dialect), cell.robot
    _check_signals(cell, language)
    axes = axis_convention(robot, language)
    program = replace(program, cautions=(*program.cautions, *jog_checks(cell, dialect)))
    files, found = write_and_read_back(in_controller_axes(program, axes, language, robot.speed), dialect, stem)
    check_model_angles(program, axes, found, language)
    check_emitted_speeds(cell, program, axes, language, found)
    return files


def _check_signals(cell: Cell, language: Dialect) -> None:
    """Refuse a dialect that has no word for the signal by which the gauge is read."""
    way = cell.gauge.read_by
    if (way == "trigger" and not language.sync.rest) or (way == "input" and not language.wait):
        lacks = "switch no output" if way == "trigger" else "wait for no input"
        raise InputError(
            f'{language.title} can {lacks}, and the cell says gauge.read_by = "{way}"; take another dialect, or '
            'read_by = "log" or "hand"'
        )


def jog_checks(cell: Cell, dialect: str) -> tuple[str, ...]:
    """Return what is to be seen at the robot as coupled axes of a dialect's controller are jogged; one sentence each.

    Raises:
        InputError: no such dialect, or the robot's file does not say how its axes count.
    """
    language = load_dialect(dialect)
    return tuple(coupling_checks(cell.robot, axis_convention(cell.robot, language), axis_names(language), cell.home))


def build_program(cell: Cell, plan_id: str, body: list[Instruction]) -> Program:
    """Return a session as a program: home first, then ``body``."""
    return Program(
        plan_id=plan_id,
        robot=cell.robot.name,
        n_joints=cell.robot.n_joints,
        home_deg=degrees(cell.home),
        instructions=(Section("home"), move_home(cell), *body),
        controller=cell.controller,
        map_mm=_mm(cell.tool.p_FM),
        mass_kg=cell.tool.mass,
        com_mm=_mm(cell.tool.com_F),
        joint_names=cell.robot.joint_names,
        joint_units=cell.robot.joint_units if cell.robot.slides.any() else (),
        cautions=(
            *(edit.remark for edit in cell.robot.hand_edits),
            *describe_unchecked_links(cell),
            *describe_parked_joints(cell),
            cell.gauge.reading_text(cell.file),
        ),
        acceleration_deg_s2=degrees(cell.robot.acceleration),
    )


def _course_instructions(cell: Cell, one: Course, form: PathForm, first: int, last_pose: int) -> list[Instruction]:
    """The session of one mounting, from home and back home; ``first`` is the number of its first start."""
    cell = cell.at(one.mounting)
    bare, removal = cell.gauge.without_gauge_text, cell.gauge.removal
    travel = joint_moves(cell, one.travel, None)
    there: list[Instruction] = [
        Section(f"to {one.start}{bare}"),
        *travel,
        *preparation(cell, one.mounting),
        WaitInput("gauge ready"),
    ]
    after = [Pause(removal)] if removal else []
    back: list[Instruction] = [*after, Section(f"back home{bare}"), *reverse_moves(travel, one.travel.q)]
    form = replace(form, dense=form.dense and cell.motion.is_continuous)
    last = StretchBegin(first + _count_starts(one) - 1)
    if not one.is_of_poses:
        passes = (item for p in _pass_instructions(cell, one, form, last_pose) for item in (last, *p, StretchEnd()))
        return [last, *there, StretchEnd(), *passes, last, *back, StretchEnd()]
    path = one.measuring
    written = measured_moves(cell, path, one.mounting, form, last_pose)
    measuring = cut_stretches(cell, one.mounting, _stop_short(cell, path), one.shortcuts, written, first)
    heading = Section(one.passes[0].heading)
    return [last, *there, StretchEnd(), heading, *measuring, last, *back, StretchEnd()]


def _pass_instructions(cell: Cell, course: Course, form: PathForm, last_pose: int) -> Iterator[list[Instruction]]:
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
            moves = measured_moves(cell, one.path, course.mounting, form, last_pose)
            written[key] = number, [item for _, item in moves]
        first, items = written[key]
        yield out + ([_shift_mark(item, number - first) for item in items] if number != first else items)


def _shift_mark(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item


def preparation(cell: Cell, mounting: Mounting) -> list[Instruction]:
    """Return the steps that a person takes with the gauge before the first pose is measured."""
    said, asked = cell.gauge.preparation(cell, mounting)
    return [*([Comment(said)] if said else []), Pause(asked)]


def reverse_moves(there: list[JointMove], q: Array) -> list[JointMove]:
    """The same legs the other way round: leg k back is leg −k−1 there, its corner the one before that."""
    blends = [0.0, *(m.blend_mm for m in there[:-1])]
    legs = zip(reversed(there), reversed(q[:-1]), reversed(blends), strict=True)
    return [replace(move, q_deg=degrees(target), blend_mm=blend, pose=None) for move, target, blend in legs]


def move_home(cell: Cell) -> JointMove:
    """The way to home is not planned: the operator stands the robot near it, and it moves slowly."""
    return JointMove(degrees(cell.home), duration_s=10.0, tool_speed_mm_s=50.0, axis_percent=5.0)


def measured_moves(
    cell: Cell, path: TimedPath, mounting: Mounting, form: PathForm, last_pose: int
) -> list[tuple[int, Instruction]]:
    """The measuring path with a mark at every pose; where the robot rests there, it is read as the cell says.

    A ball is centred before the mark: the axes are logged where the centring led them.
    Each instruction with the number of the path's point at which the way to a pose begins, or −1.
    ``last_pose``: number of the session's last pose.
    """
    out: list[tuple[int, Instruction]] = []
    if form.dense:
        out.append((-1, Comment("the blended path in small steps: every corner is already cut")))
        moves, begins = dense_moves(cell, path, mounting, form.block_s)
    else:
        rounds = circle_moves(cell, path, mounting) if form.circles else None
        moves = joint_moves(cell, path, mounting) if rounds is None else rounds
        begins = {k: k for k, move in enumerate(moves) if move.pose is not None}
    rests, short = not (cell.motion.is_continuous or form.dense), _stop_short(cell, path)
    for k, move in enumerate(moves):
        asked = "" if move.pose is None else cell.gauge.seating_step(cell, np.deg2rad(move.q_deg))
        out.append((begins.get(k, -1), replace(move, q_deg=degrees(short.q[k + 1])) if asked else move))
        if move.pose is None:
            continue
        mark: list[Instruction] = (
            [Sync(move.pose), LogAxes(move.pose)] if cell.controller.log_axes else [Sync(move.pose)]
        )
        ball = cell.gauge.ball_to_centre(cell, np.deg2rad(move.q_deg))
        if ball is not None:
            mark = [Centre(ball + 1, move.pose), *mark]
        pose = f"pose {move.pose} of {last_pose}"
        if asked:
            mark = [Pause(f"{pose}: {asked}", move.q_deg, _nearest_ball(cell, move)), *mark]
        out += [(-1, item) for item in (_read_at_rest(cell, mark, pose, seated=bool(asked)) if rests else mark)]
    return out


def _read_at_rest(cell: Cell, mark: list[Instruction], pose: str, seated: bool) -> list[Instruction]:
    """Return what the robot does where it rests at a pose, by how the cell has its gauge read.

    Args:
        cell: with the gauge.
        mark: what marks and logs the pose, and what comes before that.
        pose: its number in words, as the pendant shows it.
        seated: whether ``mark`` stops for a person already, who brings the tool into a seat.
    """
    settle, dwell = ([Dwell(s)] if s > 0.0 else [] for s in (cell.motion.settle, cell.motion.dwell))
    match cell.gauge.read_by:
        case "hand" if not seated:
            return [*settle, *mark, Pause(f"{pose}: read the gauge")]
        case "input":
            return [*settle, *mark, *dwell, WaitInput(f"{pose}: the gauge has read")]
        case _:
            return [*settle, *mark, *dwell]


def _nearest_ball(cell: Cell, move: JointMove) -> int:
    """Return the ball that a move leads to."""
    there = cell.map_position(np.deg2rad([move.q_deg]))
    return int(np.argmin(np.linalg.norm(cell.p_BS - there, axis=1)))


def _stop_short(cell: Cell, path: TimedPath) -> TimedPath:
    """Return the path with poses as far before them as a person leads the tool."""
    before = np.vstack([path.q[:1], path.q[:-1]])
    share = cell.gauge.left_to_person * (path.visit >= 0)[:, None]
    return replace(path, q=path.q + share * (before - path.q))


def _mm(p: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v) * 1e3, 9) for v in p)
    return x, y, z
