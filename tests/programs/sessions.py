"""Measuring sessions to write in every dialect."""

from dataclasses import replace

import numpy as np

from planner.cell.file import ControllerFile
from planner.programs.dialect import dialects
from planner.programs.instructions import (
    Comment,
    Dwell,
    Entry,
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

PLAN_ID = "0123456789ab"
PULSES = (1341.38, 1907.674, 1592.889, 1022.862, 980.239, 454.754, 1000.0, 500.0)  # a degree, of languages that count


def angles(n_joints: int, n_poses: int, seed: int = 0) -> list[tuple[float, ...]]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-120.0, 120.0, (n_poses, n_joints))
    q[0, :2] = [-1e-7, 1e-5]  # must be printed neither as -0.0 nor with an exponent
    return [tuple(row) for row in q.tolist()]


def _frame(n_joints: int, tour: list[Instruction]) -> Program:
    home = (0.0, -10.0, 0.0, 0.0, 90.0, 0.0, 5.0, 5.0)[:n_joints]
    mount = (40.0, -20.0, -60.0, 0.0, 45.0, 1.0, 2.0, 3.0)[:n_joints]
    start = [
        Section("home to mount, without the bar"),
        JointMove(home, 6.0, 500.0, 20.0),
        JointMove(mount, 4.0, 800.0, 35.0),
        Pause('attach the bar (both balls); zero it with the "350 mm" master\'s help \\ öäü'),
        WaitInput("gauge ready"),
        Section("tour"),
    ]
    end = [
        JointMove(mount, 30.0, 16.6, 0.61),
        Pause("take the bar off"),
        JointMove(home, 4.0, 800.0, 35.9),
        Comment("end; of (the) session"),
    ]
    return Program(
        PLAN_ID,
        "comau-nj130",
        n_joints,
        home,
        tuple([*start, *tour, *end]),
        ControllerFile(tool=1, base=0, load=2, sync_output=5, gauge_input=7),
        pulses_per_deg=PULSES[:n_joints],
    )


def with_controller(program: Program, **changes: object) -> Program:
    """The same program for a controller with other numbers, signals or limits."""
    return replace(program, controller=program.controller.model_copy(update=changes))


def static(n_joints: int = 6, n_poses: int = 4) -> Program:
    """At each pose: rest, settle, mark, log, dwell."""
    tour: list[Instruction] = []
    for pose, q in enumerate(angles(n_joints, n_poses), start=1):
        tour += [JointMove(q, 7.3, 16.6, 0.52, pose=pose), Dwell(0.5), Sync(pose), LogAxes(pose), Dwell(1.25)]
    return _frame(n_joints, tour)


def led_by_hand(n_joints: int = 6, n_poses: int = 4) -> Program:
    """A person leads the ball into a socket before each pose: a stretch begins with a stay."""
    tour: list[Instruction] = []
    for pose, q in enumerate(angles(n_joints, n_poses), start=1):
        tour += [JointMove(q, 7.3, 16.6, 0.52, pose=pose), Pause("lead the ball in"), Dwell(0.5), Sync(pose)]
        tour += [LogAxes(pose), Dwell(1.25)]
    return _frame(n_joints, tour)


def continuous(n_joints: int = 6, n_poses: int = 4) -> Program:
    """Rounded at the poses, marked in passing; a support point in between."""
    tour: list[Instruction] = []
    for pose, q in enumerate(angles(n_joints, n_poses), start=1):
        tour += [JointMove(q, 37.3, 16.6667, 0.52, 10.0, pose, 700.0), Sync(pose), LogAxes(pose)]
        support = tuple(x + 3.0 for x in q)
        tour.append(JointMove(support, 5.0, 16.0, 0.7, 7.5))
    return _frame(n_joints, tour)


def resumable(n_joints: int = 6, n_poses: int = 4, rounded: bool = False) -> Program:
    """A session that can be started at each of its poses, by a way from the mount pose."""
    program = continuous(n_joints, n_poses) if rounded else static(n_joints, n_poses)
    mount = program.moves[1].q_deg
    head, tour, tail = program.instructions[1:6], program.instructions[6:-4], program.instructions[-4:]
    out: list[Instruction] = [*program.instructions[:1], head[0], StretchBegin(n_poses), *head[1:], StretchEnd()]
    number, before = 0, mount
    for item in tour:
        if isinstance(item, JointMove):
            if item.pose is not None:
                number += 1
                if number > 1:
                    way = (
                        JointMove(tuple(q + 5.0 for q in mount), 20.0, 10.0, 0.7),
                        JointMove(before, 30.0, 10.0, 1.3),
                    )
                    out += [StretchEnd(), Entry(number, mount, way)]
                out.append(StretchBegin(number))
            before = item.q_deg
        out.append(item)
    out += [tail[0], StretchEnd(), StretchBegin(n_poses), *tail[1:], StretchEnd()]
    return replace(program, instructions=tuple(out))


def mixed(n_joints: int = 6, n_poses: int = 2) -> Program:
    """A tour in passing, with remarks between, and then the same poses once more at rest."""
    tour: list[Instruction] = []
    for item in continuous(n_joints, n_poses).instructions[6:-4]:
        tour += [item, Comment("a remark")]
    last = angles(n_joints, 1, seed=1)[0]
    tour += [JointMove(last, 20.0, 16.0, 0.5), Section("repeat")]
    tour += static(n_joints, n_poses).instructions[6:-4]
    return _frame(n_joints, tour)


def dense(n_joints: int = 6, n_steps: int = 200) -> Program:
    """A curve in steps below one degree, as a controller needs it that knows no millimetres."""
    s = np.linspace(0.0, 2.0 * np.pi, n_steps)
    mount = np.array((40.0, -20.0, -60.0, 0.0, 45.0, 1.0, 2.0)[:n_joints])
    q = mount + 10.0 * (1.0 - np.cos(s))[:, None] * np.linspace(0.4, 1.0, n_joints)
    tour: list[Instruction] = []
    for index, row in enumerate(q.tolist()):
        tour.append(JointMove(tuple(row), 0.123, 16.0, 0.5, 10.0 if index < n_steps - 1 else 0.0))
        if index % 50 == 25:
            tour += [Sync(index), LogAxes(index)]
    return _frame(n_joints, tour)


def with_circle() -> Program:
    """Three pieces of a circle of the tool, marked at the end of the second."""
    tour: list[Instruction] = [JointMove((30.0, -20.0, -60.0, 0.0, 45.0, 1.0), 4.0, 16.0, 5.0)]
    for k in range(3):
        via, end = ((30.0 + 10.0 * k + x, -20.0 + k, -60.0, 0.5 * k, 45.0, 1.0) for x in (5.0, 10.0))
        tour.append(JointMove(end, 9.0, 16.6, 100.0, 1.0 if k < 2 else 0.0, 7 if k == 1 else None, 150.0, via_deg=via))
        tour += [Sync(7), LogAxes(7)] if k == 1 else []
    return _frame(6, tour)


TURNED_DOWN = [d.name for d in dialects() if d.override.knob]  # programs of controllers, no lists of poses
