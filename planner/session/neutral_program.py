"""The whole measuring session as a neutral program: travel, attach or prepare the gauge, measure, travel back."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, to_mm
from planner.motion.timing.limits import Limits, axis_percent
from planner.motion.timing.trajectory import Trajectory
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
from planner.session.course import Course, Waypoints, is_continuous


def preparation(cell: Cell) -> list[Instruction]:
    """Return what a person does before the first pose is measured."""
    head = cell.gauge.head
    if head is None:
        return [Pause("put the reflector into its nest and let the tracker find it")]
    shown = float(to_mm(head.master / 2 - cell.balls[0].radius))
    return [
        Comment(f"master the indicators: lay the {float(to_mm(head.master)):g} mm ball into its socket"),
        Pause(f"set all three indicators to {shown:.3f} mm, then take the ball out"),
    ]


def point_instructions(
    cell: Cell, there: list[JointMove], legs: list[JointMove], back: list[JointMove]
) -> list[Instruction]:
    """Return the instructions of one course; the moves to its start, along it, and home again are given."""
    out: list[Instruction] = [Section("to where the session starts"), *there]
    out += [*preparation(cell), WaitInput("gauge ready"), Section("measuring")]
    for move in legs:
        out.append(move)
        if move.pose is not None:
            out += _pose_instructions(cell, move)
    return [*out, Section("back home"), *back]


def nearest_ball(cell: Cell, q: np.ndarray) -> int:
    """Return which ball the measured point is nearest to at q (N,) [rad], counted from 0."""
    return int(np.argmin(np.linalg.norm(cell.p_BS - cell.map_position(q[None]), axis=1)))


def _pose_instructions(cell: Cell, move: JointMove) -> list[Instruction]:
    """Settle, centre where there is a ball, mark and log: the axes are logged where the centring led them."""
    assert move.pose is not None
    mark: list[Instruction] = [Sync(move.pose), LogAxes(move.pose)] if cell.controller.log_axes else [Sync(move.pose)]
    settle, dwell = Dwell(cell.motion.settle), Dwell(cell.motion.dwell)
    if cell.gauge.head is None:
        return [settle, *mark, dwell]
    return [settle, Centre(nearest_ball(cell, np.deg2rad(move.q_deg)) + 1, move.pose), *mark, dwell]


DENSE_TRAVEL = 0.002  # [m] of the tool point between two points of a path given in small steps
LEG_SAMPLES, LEG_MARGIN = 65, 1.01  # along a leg, for the largest travel of the tool point
DENSE_TURN = 0.01  # [rad] of any axis between two such points


def session_program(cell: Cell, courses: Iterable[Course], plan_id: str, dense: bool) -> Program:
    """Assemble the session; ``dense`` writes the blended path in small steps for controllers that cannot blend it."""
    body: list[Instruction] = []
    for one in courses:
        body += _fixture_instructions(cell, one, dense)
    return build_program(cell, plan_id, body)


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


def _fixture_instructions(cell: Cell, one: Course, dense: bool) -> list[Instruction]:
    cell, name = cell.at(one.fixture), cell.fixtures[one.fixture].name
    point = cell.point_name(one.fixture)
    place, tool = cell.place_name(one.fixture), f"tool point {point}" if point else "tool"
    there = joint_moves(cell, one.travel, one.travel_trajectory, bar=False)
    if not cell.gauge.is_attached:
        legs = joint_moves(cell, one.measuring, one.trajectory, bar=True)
        return point_instructions(cell, there, legs, moves_back(there, one.travel.q))
    measuring = dense_moves(cell, one) if dense and is_continuous(cell) else measured_moves(cell, one)
    return [
        Section(f"to the mount pose of fixture {place}, without the bar"),
        *there,
        Pause(f"attach the bar (fixture {name} to {tool}), set its zero"),
        WaitInput("gauge ready"),
        Section(f"measuring on fixture {place}"),
        *measuring,
        Pause("take the bar off"),
        Section("back home, without the bar"),
        *moves_back(there, one.travel.q),
    ]


def moves_back(there: list[JointMove], q: Array) -> list[JointMove]:
    """The same legs the other way round: leg k back is leg −k−1 there, its corner the one before that."""
    blends = [0.0, *(m.blend_mm for m in there[:-1])]
    legs = zip(reversed(there), reversed(q[:-1]), reversed(blends), strict=True)
    return [replace(move, q_deg=_deg(target), blend_mm=blend, pose=None) for move, target, blend in legs]


def move_home(cell: Cell) -> JointMove:
    """The way to home is not planned: the operator stands the robot near it, and it moves slowly."""
    return JointMove(_deg(cell.home), duration_s=10.0, tool_speed_mm_s=50.0, axis_percent=5.0)


def joint_moves(cell: Cell, path: Waypoints, trajectory: Trajectory, bar: bool) -> list[JointMove]:
    """One joint move a leg of the path, with the blends that the trajectory has."""
    robot = cell.robot
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


def measured_moves(cell: Cell, one: Course) -> list[Instruction]:
    """The measuring path leg by leg, a mark at every pose."""
    out: list[Instruction] = []
    for move in joint_moves(cell, one.measuring, one.trajectory, bar=True):
        out.append(move)
        if move.pose is not None:
            mark = _mark(cell, move.pose)
            rest = not is_continuous(cell)
            out += [Dwell(cell.motion.settle), *mark, Dwell(cell.motion.dwell)] if rest else mark
    return out


def _mark(cell: Cell, pose: int) -> list[Instruction]:
    return [Sync(pose), LogAxes(pose)] if cell.controller.log_axes else [Sync(pose)]


def dense_moves(cell: Cell, one: Course) -> list[Instruction]:
    """The blended path in small steps, each with the time it takes; corners stay inside what was proven."""
    trajectory, ids = one.trajectory, one.measuring.visit
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
