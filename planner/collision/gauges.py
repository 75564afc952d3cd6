"""Bodies of gauges without a bar: the indicators' tips, the artifact with its balls and stems, a tracker's beam."""

from dataclasses import replace

import numpy as np

from planner.bodies import Body, capsule
from planner.cell import Ball, Cell
from planner.collision.pieces import Piece, reach_of
from planner.units import Array, frozen
from planner.workspace import axis_reach

SHAFT = 30e-3  # [m] from the MAP to where the channel holds the indicator's shaft: a tip ends there


def tips(cell: Cell) -> list[Body]:
    """Return the indicators' tips in the flange frame, where they stand when a ball is centred (TriCal paper, 2.1).

    The round end of the capsule stands out of the flat disk by as much as its rim is cut off.
    """
    head = cell.gauge.head
    if head is None:
        return []
    radius, touch = head.tip / 2, min(b.radius for b in cell.balls)
    bodies = []
    for k, axis in enumerate(head.axes_F):
        a, b = (cell.tool.p_FM + axis * s for s in (touch + radius / 2, SHAFT))
        bodies.append(capsule(f"tip of indicator {k + 1}", a, b, radius))
    return bodies


def artifact(cell: Cell) -> list[Piece]:
    """Return the artifact's bodies, balls and stems in the base frame, as the cell says that it stands."""
    if not cell.gauge.head:
        return []
    place = cell.fixtures[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = place.R_BX, place.p_BX
    bodies = [replace(b, T=frozen(T @ b.T)) for b in cell.carrier]
    balls = [_ball(b, T) for b in cell.balls]
    stems = [s for b in cell.balls if (s := _stem(b, T)) is not None]
    return [
        *(Piece(b, "world", 0, reach_of(b)) for b in (*bodies, *stems)),
        *(Piece(b, "world", 0, reach_of(b), ball=k) for k, b in enumerate(balls)),
    ]


def beam(cell: Cell) -> Piece:
    """Return the tracker's beam from the reflector on, past all that the robot can put in its way."""
    assert cell.file.tracker is not None
    radius = cell.file.tracker.beam_radius_mm * 1e-3
    far = float(np.linalg.norm(cell.fixtures[0].p_BX)) - float(
        axis_reach(cell.chain.transforms, cell.robot.n_joints)[0]
    )
    z, start = np.array([0.0, 0.0, 1.0]), cell.gauge.trim + radius
    body = capsule("tracker's beam", -z * start, -z * max(far, cell.gauge.length_min, 2 * start), radius)
    return Piece(body, "rod", 0, reach_of(body))


def _ball(ball: Ball, T: Array) -> Body:
    place = np.eye(4)
    place[:3, 3] = ball.p_GS
    return Body(f"ball {ball.name}", "sphere", (ball.radius,), frozen(T @ place))


def _stem(ball: Ball, T: Array) -> Body | None:
    """A capsule that begins inside the ball, so that its round end does not stand out of it."""
    if ball.stem is None:
        return None
    way = ball.stem - ball.p_GS
    length = float(np.linalg.norm(way))
    start = min(ball.radius - ball.stem_radius, length)
    body = capsule(f"stem of ball {ball.name}", ball.p_GS + way / length * max(start, 0.0), ball.stem, ball.stem_radius)
    return replace(body, T=frozen(T @ body.T))
