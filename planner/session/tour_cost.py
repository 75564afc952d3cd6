"""What a leg of the tour costs, the time of its slowest limit, and how long a session takes."""

from collections.abc import Callable, Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.motion.tour.instance import slowest_axis_cost
from planner.runs.run import Mounting
from planner.session.course import axis_limits, tool_speed
from planner.session.plan_types import Drive

PIECES = 16  # of a leg, each driven at its own slowest limit
CHUNK = 4096  # legs at a time


def leg_times(cell: Cell, mounting: Mounting, start: Array, end: Array) -> Array:
    """Return the time of straight joint legs (m, N) [rad] with the gauge attached, (m,) [s].

    Each piece of a leg takes as long as its slowest limit: the axes' speeds that are allowed, the tool's speed, the
    gauge's rate. Acceleration, dwells and detours are not in it. Where the cell asks for ``tour_cost = "axes"``, it is
    the slowest axis at full speed alone (EDBB paper, eq. 7).
    """
    if cell.motion.tour_cost == "axes":
        return _axis_times(start, end, cell.robot.speed)
    speed, limit = axis_limits(cell, bar=True).speed, tool_speed(cell, bar=True)
    by_axes = _axis_times(start, end, speed)
    if not np.isfinite(limit):
        return by_axes
    chunks = range(0, len(start), CHUNK)
    moving = [_moving_times(cell, mounting, start[k : k + CHUNK], end[k : k + CHUNK], limit) for k in chunks]
    pieces = np.maximum(np.concatenate([*moving, np.empty((0, PIECES))]), by_axes[:, None] / PIECES)
    return np.asarray(pieces.sum(axis=1))


def tour_costs(cell: Cell, mounting: Mounting, nodes: Array) -> Array:
    """Return the cost of the leg between any two of the nodes (n, N) [rad], (n, n) [s], the same both ways."""
    if cell.motion.tour_cost == "axes":
        return slowest_axis_cost(nodes, cell.robot.speed)
    a, b = np.triu_indices(len(nodes), 1)
    cost = np.zeros((len(nodes), len(nodes)))
    cost[a, b] = cost[b, a] = leg_times(cell, mounting, nodes[a], nodes[b])
    return cost


def cost_name(cell: Cell) -> str:
    """Say what the tour is the shortest of."""
    if cell.motion.tour_cost == "axes":
        return "slowest axis at full speed"
    limited = np.isfinite(tool_speed(cell, bar=True))
    return "slowest of axes, tool speed and gauge rate" if limited else "slowest axis at the speed allowed"


def _axis_times(start: Array, end: Array, speed: Array) -> Array:
    return np.asarray((np.abs(end - start) / speed).max(axis=1, initial=0.0))


def _moving_times(cell: Cell, mounting: Mounting, start: Array, end: Array, limit: float) -> Array:
    """Time that tool and gauge need for each piece of each leg, (m, PIECES) [s]."""
    share = np.linspace(0.0, 1.0, PIECES + 1)[:, None, None]
    q = start + share * (end - start)
    x = cell.at(mounting).map_position(q.reshape(-1, q.shape[2])).reshape(*q.shape[:2], 3)
    out = np.linalg.norm(np.diff(x, axis=0), axis=2) / limit
    if np.isfinite(cell.gauge.rate):
        length = np.linalg.norm(x - cell.fixtures[mounting.fixture].p_BX, axis=2)
        out = np.maximum(out, np.abs(np.diff(length, axis=0)) / cell.gauge.rate)
    return np.asarray(out.T)


DIMENSIONS = 6  # of joint space: the shortest tour of n points in d dimensions grows as n^(1 − 1/d)


def session_minutes(cell: Cell, drives: Sequence[Drive], poses: int) -> Callable[[int], float]:
    """Return what tells the minutes of driving of another number of poses, about, from the session that was planned.

    Each visit stands still for its dwell; the way between them grows as the shortest tour of random points does
    (Beardwood, Halton and Hammersley 1959, Math. Proc. Cambridge Phil. Soc. 55(4)).
    """
    visits = sum(len(d.visits) for d in drives)
    still = cell.motion.dwell + cell.motion.settle if cell.motion.measure == "static" else 0.0
    moving = sum(d.trajectory.duration_s for d in drives) - visits * still

    def minutes(count: int) -> float:
        other = visits - poses + count
        return float(other * still + moving * (other / visits) ** (1 - 1 / DIMENSIONS)) / 60

    return minutes
