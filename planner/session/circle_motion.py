"""How the joints move while the tool runs on circles without turning, as controllers drive them."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.units import Array
from planner.kinematics.geometry import fit_circle_in_space, points_on_arc
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
from planner.session.tolerances import CIRCLE_END_OFF

STEP = np.deg2rad(1.0)  # of a circle between two points at which the joints are found

Angles = tuple[float, ...]
CirclePiece = tuple[Angles, Angles, Angles]
"""Angles where a piece of a circle begins, at a point of it, and where it ends (N,) [deg]."""


def circle_polygons(cell: Cell, pieces: Sequence[CirclePiece]) -> list[list[Angles]]:
    """Return the corners (k, N) [deg] of a polygon about the way of the joints on each piece, its end included.

    Between two points that are found the joints run on a parabola nearly (the rest is below 1e-7 rad), which lies in
    the triangle of the points and the polygon's corner between them.

    Raises:
        NoSolutionError: the joints do not lead round a piece to where it ends.
    """
    if not pieces:
        return []
    ends = np.deg2rad(np.array(pieces))  # (P, 3, N)
    tool = [cell.map_position(e) for e in ends]
    turn = max(points_on_arc(x, np.zeros(1))[1] / fit_circle_in_space(x)[2] for x in tool)
    count = max(8, int(np.ceil(turn / STEP)))  # steps of a piece at least
    x = np.stack([points_on_arc(one, np.linspace(0.0, 1.0, 2 * count + 1))[0] for one in tool], axis=1)
    points = _follow(cell, ends[:, 0], x)
    if not np.abs(points[-1] - ends[:, 2]).max() <= CIRCLE_END_OFF:
        raise NoSolutionError("on a circle the joints do not come to where it ends: the arm would turn its tool")
    corners = np.rad2deg(2 * points[1::2] - (points[:-2:2] + points[2::2]) / 2)
    return [[*map(tuple, corners[:, k].tolist()), piece[2]] for k, piece in enumerate(pieces)]


def _follow(cell: Cell, q: Array, x: Array) -> Array:
    """Return the joints (k, P, N) [rad] from q (P, N) on, with the tool at x (k, P, 3) [m] and never turned."""
    branch = np.deg2rad(20.0)  # that no joint turns from one point to the next, unless the arm passes a singular pose
    R = tool_pose(cell.chain, cell.robot, q)[1]
    out = [q]
    for there in x[1:]:
        guess = out[-1] if len(out) == 1 else 2 * out[-1] - out[-2]
        # 8: rounds of Newton from one point to the next
        found, good = solve_pose_ik(cell.chain, cell.robot, guess, there, R, 8)
        if not good.all() or np.abs(found - out[-1]).max() > branch:
            raise NoSolutionError("the arm does not get round a circle without turning the tool")
        out.append(found)
    return np.array(out)
