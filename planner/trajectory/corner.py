"""Where the tour leaves its polyline: entry and exit of every blended corner, from a radius in task space."""

from dataclasses import dataclass

import numpy as np

from planner.trajectory.limits import Index, Mask, Request, ToolPosition
from planner.units import Array, frozen

SAME = 1e-8  # [rad] path points nearer than this are one point
REVERSAL = 1e-6  # 1 + cos(turn) below this is a reversal: nothing to blend, the tour must stop
PACE_RATIO = 4.0  # the two halves of a blend may differ by this factor in time at the pace of their legs
PACE_SAMPLES = 9  # of the tool point along each leg
GRID = 32  # samples of half a leg that bracket the first crossing of the radius
BISECTIONS = 26  # 1 / (GRID · 2^26): 5e-10 of half a leg


@dataclass(frozen=True)
class Corners:
    """The polyline without its repeated points, and where each corner is cut.

    q (M, N) distinct points [rad]; node (m,) the distinct point of each path point; stop (M,) the points of rest,
    reversals and corners without a radius included; entry, exit (M, N) [rad] where the blend begins on the incoming
    and ends on the outgoing leg, equal to q at stops; share_in, share_out (M,) the parts of both legs that it takes, at
    most 1/2, 0 at stops; pace (M-1,) [rad/s] a joint-space speed at which each leg could be driven on average.
    Every blended path stays inside the triangles (entry, q, exit) and on the straight legs between them.
    """

    q: Array
    node: Index
    stop: Mask
    entry: Array
    exit: Array
    share_in: Array
    share_out: Array
    pace: Array


def distinct_points(path_q: Array) -> Index:
    """Return for each path point (m,) the number of its distinct point; a run of equal points shares one."""
    node = np.zeros(len(path_q), dtype=np.intp)
    kept = path_q[0]
    for i in range(1, len(path_q)):
        moved = float(np.linalg.norm(path_q[i] - kept)) > SAME
        node[i] = node[i - 1] + moved
        kept = path_q[i] if moved else kept
    return node


def round_corners(request: Request, tool_position: ToolPosition, speed: Array) -> Corners:
    """Find entry and exit of every corner: the tool point is blend_m away from it, at most half a leg.

    speed (N,) [rad/s] are the joints' limits. Where one side is short, the other is cut to PACE_RATIO times its time.
    """
    node = distinct_points(request.path_q)
    count = int(node[-1]) + 1
    first = np.searchsorted(node, np.arange(count))
    q = request.path_q[first]
    blend = np.minimum.reduceat(request.blend_m, first)
    leg = np.diff(q, axis=0)
    length = np.linalg.norm(leg, axis=1)
    stop = np.logical_or.reduceat(request.stop, first) | (blend <= 0.0)
    if count > 2:
        turn = np.einsum("ij,ij->i", leg[:-1], leg[1:]) / (length[:-1] * length[1:])
        stop[1:-1] |= 1.0 + turn < REVERSAL
    tool_speed = request.tool_speed[np.diff(node) > 0]
    pace = _pace(q, stop, tool_speed, tool_position, speed) if count > 1 else np.zeros(0)
    share_in, share_out = np.zeros(count), np.zeros(count)
    corner = np.flatnonzero(~stop)
    if len(corner):
        away = np.concatenate([-leg[corner - 1], leg[corner]])
        share = _crossing(np.tile(q[corner], (2, 1)), 0.5 * away, np.tile(blend[corner], 2), tool_position)
        part_in, part_out = 0.5 * share.reshape(2, -1)
        time_in, time_out = part_in * length[corner - 1] / pace[corner - 1], part_out * length[corner] / pace[corner]
        share_in[corner] = part_in * np.minimum(1.0, PACE_RATIO * time_out / time_in)
        share_out[corner] = part_out * np.minimum(1.0, PACE_RATIO * time_in / time_out)
    entry, leave = q.copy(), q.copy()
    entry[1:] -= share_in[1:, None] * leg
    leave[:-1] += share_out[:-1, None] * leg
    parts = (frozen(part) for part in (entry, leave, share_in, share_out, pace))
    return Corners(frozen(q), node, stop, *parts)


def _pace(q: Array, stop: Mask, tool_speed: Array, tool_position: ToolPosition, speed: Array) -> Array:
    """Return the joint-space speed (M-1,) [rad/s] on each leg that the joints and the tool's limit allow on average.

    Between two stops the lowest limit of the tool counts for all legs: such a pace changes little from leg to leg, and
    what a leg may do beyond it is left to the profile.
    """
    leg = np.diff(q, axis=0)
    share = np.linspace(0.0, 1.0, PACE_SAMPLES)
    rows = q[:-1, None, :] + share[:, None] * leg[:, None, :]
    x = tool_position(rows.reshape(-1, q.shape[1])).reshape(len(leg), PACE_SAMPLES, 3)
    travel = np.linalg.norm(np.diff(x, axis=1), axis=2).sum(axis=1)
    slowest = np.minimum.reduceat(tool_speed, np.flatnonzero(stop[:-1]))[np.cumsum(stop[:-1]) - 1]
    needs = np.maximum(travel / slowest, (np.abs(leg) / speed).max(axis=1))
    return np.asarray(np.linalg.norm(leg, axis=1) / needs)


def _crossing(q: Array, half: Array, radius: Array, tool_position: ToolPosition) -> Array:
    """Return the first share (n,) in (0, 1] of ``half`` at which the tool point has come ``radius`` away."""
    x_corner = tool_position(q)
    share = np.linspace(0.0, 1.0, GRID + 1)
    rows = (q[:, None, :] + share[:, None] * half[:, None, :]).reshape(-1, q.shape[1])
    away = np.linalg.norm(tool_position(rows).reshape(len(q), -1, 3) - x_corner[:, None, :], axis=2)
    beyond = away >= radius[:, None]
    found = beyond.any(axis=1)
    high = np.where(found, share[np.argmax(beyond, axis=1)], 1.0)
    low = np.where(found, high - 1.0 / GRID, 1.0)
    for _ in range(BISECTIONS if found.any() else 0):
        middle = 0.5 * (low + high)
        far = np.linalg.norm(tool_position(q + middle[:, None] * half) - x_corner, axis=1) >= radius
        low, high = np.where(far, low, middle), np.where(far, middle, high)
    return np.where(found, low, 1.0)
