"""Paths on which the tool runs round a circle without turning, as pieces of the circle that a controller drives itself.

A tool that keeps its orientation moves every one of its points alike, so the circle is the same whatever tool the
controller has selected; start, middle and end of each piece are joint angles, whose places it works out itself.
"""

from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.common.circles_in_space import fit_circle_in_space, points_on_arc
from planner.common.units import Array
from planner.kinematics.chain import Chain
from planner.programs.instructions import JointMove
from planner.runs.run import Mounting
from planner.session.course import TimedPath
from planner.session.driven_moves import degrees, joint_moves

LONGEST_PIECE = np.deg2rad(120.0)  # controllers allow 180 to 240 degrees
ROUND, STEADY = 1e-6, 1e-6  # [m], [rad] that points may lie off the circle, and the tool may turn
TRANSITION_MM = 1.0  # from one piece of a circle to the next


def circle_moves(cell: Cell, path: TimedPath, mounting: Mounting) -> list[JointMove] | None:
    """Return the pieces of a circle, or nothing where the path is none, or the tool turns on it.

    A piece ends at every mark of the path.
    """
    x, R = _tool_poses(cell, path.q)
    found = _circle_angles(x, R)
    if found is None or (path.trajectory.stop[1:-1]).any():
        return None
    edges = np.unique([0, *np.flatnonzero(path.visit >= 0), len(path.q) - 1])
    steps = joint_moves(cell, path, mounting)
    ends = [0]
    for a, b in pairwise(edges):
        count = int(min(np.ceil((found[b] - found[a]) / LONGEST_PIECE), (b - a) // 2))
        if count == 0:  # two points have no middle: a joint move would have to stop at both
            return None
        ends += [int(e) for e in np.round(np.linspace(a, b, count + 1))[1:]]
    return [_piece(path, steps[a:b], x[[a, (a + b) // 2, b]], a, b) for a, b in pairwise(ends)]


def _piece(path: TimedPath, steps: list[JointMove], x: Array, a: int, b: int) -> JointMove:
    """Return the move from point a of the path to point b, through the one in the middle; x (3, 3) [m]."""
    time, last = path.trajectory.waypoint_time, b == len(path.q) - 1
    return JointMove(
        degrees(path.q[b]),
        duration_s=float(time[b] - time[a]),
        tool_speed_mm_s=min(max(s.tool_speed_mm_s for s in steps), min(s.tool_limit_mm_s for s in steps)),
        axis_percent=100.0,
        blend_mm=0.0 if last else TRANSITION_MM,
        pose=int(path.visit[b]) if path.visit[b] >= 0 else None,
        tool_travel_mm=points_on_arc(x, np.zeros(1))[1] * 1e3,
        tool_limit_mm_s=min(s.tool_limit_mm_s for s in steps),
        mounting=steps[0].mounting,
        via_deg=degrees(path.q[(a + b) // 2]),
    )


def _tool_poses(cell: Cell, q: Array) -> tuple[Array, Array]:
    """Places (m, 3) [m] and orientations (m, 3, 3) of the tool at q (m, N) [rad]."""
    robot = cell.robot
    R = np.moveaxis(Chain(robot.transforms).forward(robot.theta(q)).R, 2, 0)
    return cell.map_position(q), R


def _circle_angles(x: Array, R: Array) -> Array | None:
    """Return the angle (m,) [rad] that points x (m, 3) [m] have come round their circle, or nothing."""
    if len(x) < 3 or np.abs(R - R[0]).max() > STEADY:
        return None
    centre, axes, radius = fit_circle_in_space(x)
    u, v, height = axes @ (x - centre).T
    if max(np.abs(np.hypot(u, v) - radius).max(), np.abs(height).max()) > ROUND:
        return None
    angle = np.unwrap(np.arctan2(v, u))
    angle = (angle - angle[0]) * np.sign(angle[-1] - angle[0])
    return angle if (np.diff(angle) > 0.0).all() else None
