"""The session of a gauge without a bar as a neutral program: master or put the reflector in, measure, go home."""

import numpy as np

from planner.cell import Cell
from planner.program import Centre, Comment, Dwell, Instruction, JointMove, LogAxes, Pause, Section, Sync, WaitInput
from planner.units import to_mm


def preparing(cell: Cell) -> list[Instruction]:
    """Return what a person does before the first pose is measured."""
    head = cell.gauge.head
    if head is None:
        return [Pause("put the reflector into its nest and let the tracker find it")]
    shown = float(to_mm(head.master / 2 - cell.balls[0].radius))
    return [
        Comment(f"master the indicators: lay the {float(to_mm(head.master)):g} mm ball into its socket"),
        Pause(f"set all three indicators to {shown:.3f} mm, then take the ball out"),
    ]


def of_points(cell: Cell, there: list[JointMove], legs: list[JointMove], back: list[JointMove]) -> list[Instruction]:
    """Return the instructions of one course; the moves to its start, along it, and home again are given."""
    out: list[Instruction] = [Section("to where the session starts"), *there]
    out += [*preparing(cell), WaitInput("gauge ready"), Section("measuring")]
    for move in legs:
        out.append(move)
        if move.pose is not None:
            out += _at_pose(cell, move)
    return [*out, Section("back home"), *back]


def ball_at(cell: Cell, q: np.ndarray) -> int:
    """Return which ball the measured point is nearest to at q (N,) [rad], counted from 0."""
    return int(np.argmin(np.linalg.norm(cell.p_BS - cell.map_position(q[None]), axis=1)))


def _at_pose(cell: Cell, move: JointMove) -> list[Instruction]:
    """Settle, centre where there is a ball, mark and log: the axes are logged where the centring led them."""
    assert move.pose is not None
    mark: list[Instruction] = [Sync(move.pose), LogAxes(move.pose)] if cell.controller.log_axes else [Sync(move.pose)]
    settle, dwell = Dwell(cell.motion.settle), Dwell(cell.motion.dwell)
    if cell.gauge.head is None:
        return [settle, *mark, dwell]
    return [settle, Centre(ball_at(cell, np.deg2rad(move.q_deg)) + 1, move.pose), *mark, dwell]
