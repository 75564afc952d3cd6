"""The whole measuring session as a neutral program: travel, attach or prepare the gauge, measure, travel back."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.motion.timing.limits import Limits, axis_percent
from planner.motion.timing.trajectory import Trajectory
from planner.programs.dialect import load_dialect
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
    Sync,
    WaitInput,
)
from planner.programs.program_files import write_program
from planner.session.course import Course, Pass, TimedPath, is_continuous, rests_at_poses
from planner.session.plan_types import Programs

DENSE_TRAVEL = 0.002  # [m] of the tool point between two points of a path given in small steps
LEG_SAMPLES, LEG_MARGIN = 65, 1.01  # along a leg, for the largest travel of the tool point
DENSE_TURN = 0.01  # [rad] of any axis between two such points


def session_program(cell: Cell, courses: Iterable[Course], plan_id: str, dense: bool) -> Program:
    """Assemble the session; ``dense`` writes the blended path in small steps for controllers that cannot blend it."""
    body: list[Instruction] = []
    for one in courses:
        body += _course_instructions(cell, one, dense)
    return build_program(cell, plan_id, body)


def assemble_programs(dialects: Sequence[str], assemble: Callable[[bool], Program]) -> dict[str, Program]:
    """Return the neutral program for each dialect; ``assemble`` is told whether the path is wanted in small steps."""
    dense = {name: load_dialect(name).wants_dense_path for name in dialects}
    made = {kind: assemble(kind) for kind in sorted(set(dense.values()))}
    return {name: made[kind] for name, kind in dense.items()}


def write_programs(cell: Cell, programs: Mapping[str, Program]) -> Programs:
    """Write a session in each dialect; every program is read back and compared before it is returned."""
    stem = f"{cell.robot.name}_{cell.name.rpartition('/')[2]}"
    return tuple((name, write_program(program, name, stem)) for name, program in programs.items())


def build_program(cell: Cell, plan_id: str, body: list[Instruction]) -> Program:
    """Return a session as a program: home first, then ``body``."""
    control = cell.controller
    return Program(
        plan_id=plan_id,
        robot=cell.robot.name,
        n_joints=cell.robot.n_joints,
        home_deg=_deg(cell.home),
        instructions=(Section("home"), move_home(cell), *body),
        tool=control.tool,
        base=control.base,
        load=control.load,
        sync_output=control.sync_output,
        gauge_input=control.gauge_input,
        map_mm=_mm(cell.tool.p_FM),
        mass_kg=cell.tool.mass,
        com_mm=_mm(cell.tool.com_F),
    )


def _course_instructions(cell: Cell, one: Course, dense: bool) -> list[Instruction]:
    """The session of one fixture, from home and back home."""
    cell = cell.at(one.fixture)
    bare = ", without the bar" if cell.gauge.is_attached else ""
    travel = joint_moves(cell, one.travel, bar=False)
    there = [Section(f"to {one.start}{bare}"), *travel, *preparation(cell, one.fixture), WaitInput("gauge ready")]
    after = [Pause("take the bar off")] if cell.gauge.is_attached else []
    moves = _pass_instructions(cell, one.passes, dense and not rests_at_poses(cell))
    return [*there, *moves, *after, Section(f"back home{bare}"), *moves_back(travel, one.travel.q)]


def _pass_instructions(cell: Cell, passes: Iterable[Pass], dense: bool) -> list[Instruction]:
    """Every pass with its heading; where the load changes, the operator sets it."""
    out: list[Instruction] = []
    written: dict[tuple[int, int], tuple[int, list[Instruction]]] = {}
    load: float | None = None
    for one in passes:
        if one.load is not None and one.load != load:
            load = one.load
            out.append(Pause(f"set the load to {load:g} N"))
        out.append(Section(one.heading))
        key, number = (id(one.trajectory), id(one.path.q)), min(one.marks, default=0)
        if key not in written:  # a repeat is the same path with other marks
            written[key] = number, (dense_moves if dense else measured_moves)(cell, one.path)
        first, moves = written[key]
        out += [_shift_mark(item, number - first) for item in moves] if number != first else moves
    return out


def _shift_mark(item: Instruction, shift: int) -> Instruction:
    """The same move or mark in another pass."""
    if isinstance(item, Sync | LogAxes):
        return replace(item, pose=item.pose + shift)
    if isinstance(item, JointMove) and item.pose is not None:
        return replace(item, pose=item.pose + shift)
    return item


def preparation(cell: Cell, fixture: int) -> list[Instruction]:
    """Return what a person does with the gauge before the first pose is measured."""
    if not cell.gauge.is_attached:
        said, asked = cell.gauge.preparation(cell)
        return [*([Comment(said)] if said else []), Pause(asked)]
    point = cell.point_name(fixture)
    tool = f"tool point {point}" if point else "tool"
    return [Pause(f"attach the bar (fixture {cell.fixtures[fixture].name} to {tool}), set its zero")]


def moves_back(there: list[JointMove], q: Array) -> list[JointMove]:
    """The same legs the other way round: leg k back is leg −k−1 there, its corner the one before that."""
    blends = [0.0, *(m.blend_mm for m in there[:-1])]
    legs = zip(reversed(there), reversed(q[:-1]), reversed(blends), strict=True)
    return [replace(move, q_deg=_deg(target), blend_mm=blend, pose=None) for move, target, blend in legs]


def move_home(cell: Cell) -> JointMove:
    """The way to home is not planned: the operator stands the robot near it, and it moves slowly."""
    return JointMove(_deg(cell.home), duration_s=10.0, tool_speed_mm_s=50.0, axis_percent=5.0)


def joint_moves(cell: Cell, path: TimedPath, bar: bool) -> list[JointMove]:
    """One joint move a leg of the path, with the blends that the trajectory has."""
    robot, trajectory = cell.robot, path.trajectory
    percent = axis_percent(
        path.q,
        tool_speed=np.maximum(trajectory.leg_peak_tool_speed, 1e-6),
        tool_jacobian=cell.map_jacobian,
        limits=Limits(robot.speed, robot.acceleration, robot.jerk),
    )
    highest = 100.0 if bar and is_continuous(cell) else 100.0 * cell.motion.travel
    run = _leg_travel(cell, path.q)
    radius = np.linalg.norm(cell.map_position(trajectory.entry) - cell.map_position(path.q), axis=1)
    return [
        JointMove(
            _deg(path.q[k + 1]),
            duration_s=max(float(trajectory.leg_duration[k]), 1e-3),
            tool_speed_mm_s=float(trajectory.leg_peak_tool_speed[k]) * 1e3,
            axis_percent=float(np.clip(percent[k], 0.01, highest)),
            blend_mm=0.0 if trajectory.stop[k + 1] else float(radius[k + 1]) * 1e3,
            pose=int(path.visit[k + 1]) if path.visit[k + 1] >= 0 else None,
            tool_travel_mm=float(run[k]) * 1e3,
        )
        for k in range(len(path.q) - 1)
    ]


def _leg_travel(cell: Cell, q: Array) -> Array:
    """Largest |dx/ds| of the tool point on each joint leg, s from 0 to 1 along it, (m − 1,) [m]."""
    leg, share = np.diff(q, axis=0), np.linspace(0.0, 1.0, LEG_SAMPLES)
    states = q[:-1, None] + share[:, None] * leg[:, None]
    J = cell.map_jacobian(states.reshape(-1, q.shape[1])).reshape(len(leg), LEG_SAMPLES, 3, -1)
    return np.asarray(np.linalg.norm(np.einsum("lsij,lj->lsi", J, leg), axis=2).max(axis=1) * LEG_MARGIN)


def measured_moves(cell: Cell, path: TimedPath) -> list[Instruction]:
    """The measuring path leg by leg, a mark at every pose; where the robot rests there, it settles and dwells.

    A ball is centred before the mark: the axes are logged where the centring led them.
    """
    out: list[Instruction] = []
    for move in joint_moves(cell, path, bar=True):
        out.append(move)
        if move.pose is None:
            continue
        mark = _mark(cell, move.pose)
        if cell.gauge.head is not None:
            mark = [Centre(nearest_ball(cell, np.deg2rad(move.q_deg)) + 1, move.pose), *mark]
        out += [Dwell(cell.motion.settle), *mark, Dwell(cell.motion.dwell)] if rests_at_poses(cell) else mark
    return out


def nearest_ball(cell: Cell, q: np.ndarray) -> int:
    """Return which ball the measured point is nearest to at q (N,) [rad], counted from 0."""
    return int(np.argmin(np.linalg.norm(cell.p_BS - cell.map_position(q[None]), axis=1)))


def _mark(cell: Cell, pose: int) -> list[Instruction]:
    return [Sync(pose), LogAxes(pose)] if cell.controller.log_axes else [Sync(pose)]


def dense_moves(cell: Cell, path: TimedPath) -> list[Instruction]:
    """The blended path in small steps, each with the time it takes; corners stay inside what was proven."""
    trajectory, ids = path.trajectory, path.visit
    t = _dense_times(cell, trajectory)
    motion = trajectory.at(t)
    marks = {
        int(np.argmin(np.abs(t[1:] - s))): int(i)
        for s, i in zip(trajectory.waypoint_time[1:], ids[1:], strict=True)
        if i >= 0
    }
    out: list[Instruction] = [Comment("the blended path in small steps: every corner is already cut")]
    step = np.diff(t)
    full = np.abs(np.diff(motion.q, axis=0)) / cell.robot.speed / step[:, None] * 100
    for k in range(len(step)):
        speed = float(motion.tool_speed[k : k + 2].max()) * 1e3
        percent = float(np.clip(full[k].max(), 0.01, 100.0))
        rest = k + 1 == len(step) or motion.tool_speed[k + 1] == 0.0
        blend = 0.0 if rest else 1e3 * DENSE_TRAVEL / 2
        out.append(JointMove(_deg(motion.q[k + 1]), float(step[k]), speed, percent, blend, marks.get(k)))
        if k in marks:
            out += _mark(cell, marks[k])
    return out


def _dense_times(cell: Cell, trajectory: Trajectory) -> Array:
    """Times at which the path is written: never more than the steps above apart, and at every waypoint."""
    fine = np.unique(np.concatenate([trajectory.sample_times(0.02), trajectory.waypoint_time]))
    motion = trajectory.at(fine)
    x = cell.map_position(motion.q)
    travel = np.linalg.norm(np.diff(x, axis=0), axis=1) / DENSE_TRAVEL
    turn = np.abs(np.diff(motion.q, axis=0)).max(axis=1) / DENSE_TURN
    covered = np.concatenate([[0.0], np.cumsum(np.maximum(travel, turn))])
    count = int(np.ceil(covered[-1]))
    even = np.interp(np.arange(count + 1) * covered[-1] / max(count, 1), covered, fine)
    times = np.unique(np.concatenate([even, trajectory.waypoint_time]))
    return np.asarray(times[np.concatenate([[True], np.diff(times) > 5e-3])])


def _mm(p: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v) * 1e3, 9) for v in p)
    return x, y, z


def _deg(q: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in np.rad2deg(q))
