"""Time of straight joint legs by their slowest limit: the axes, the tool's speed, the gauge's rate."""

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import CACHED_ROWS, Array
from planner.motion.timing.curve import Limits
from planner.runs.run import Mounting

LEG_PIECES = 16  # of a leg, each driven at its own slowest limit


def axis_limits(cell: Cell, bar: bool) -> Limits:
    """Axis limits; where the robot does not measure on the way, its speed is the allowed part of full speed."""
    robot = cell.robot
    slow = 1.0 if bar and cell.motion.is_continuous else cell.motion.travel
    return Limits(robot.speed * slow, robot.acceleration, robot.jerk)


def tool_speed(cell: Cell, bar: bool) -> float:
    """Limit of the tool point's speed [m/s] while a gauge is attached or read while moving, else none."""
    return cell.gauge.tool_speed(cell) if bar else np.inf


def axis_times(start: Array, end: Array, speed: Array) -> Array:
    """Return the time of the slowest axis of each leg (m, N) [rad], (m,) [s]."""
    return np.asarray((np.abs(end - start) / speed).max(axis=1, initial=0.0))


def limit_times(cell: Cell, mounting: Mounting, start: Array, end: Array, bar: bool = True) -> Array:
    """Return the time of straight joint legs (m, N) [rad] with the gauge attached or without it, (m,) [s].

    Each piece of a leg takes as long as its slowest limit: the axes' speeds that are allowed, the tool's speed, the
    gauge's rate. Acceleration, dwells and detours are not in it.
    """
    limit = tool_speed(cell, bar)
    by_axes = axis_times(start, end, axis_limits(cell, bar).speed)
    if not np.isfinite(limit):
        return by_axes
    chunks = range(0, len(start), CACHED_ROWS)
    moving = [
        _moving_times(cell, mounting, start[k : k + CACHED_ROWS], end[k : k + CACHED_ROWS], limit) for k in chunks
    ]
    pieces = np.maximum(np.concatenate([*moving, np.empty((0, LEG_PIECES))]), by_axes[:, None] / LEG_PIECES)
    return np.asarray(pieces.sum(axis=1))


def _moving_times(cell: Cell, mounting: Mounting, start: Array, end: Array, limit: float) -> Array:
    """Time that tool and gauge need for each piece of each leg, (m, LEG_PIECES) [s]."""
    travel, change = travel_and_length_change(cell, mounting, tool_positions(cell, mounting, start, end, LEG_PIECES))
    return np.maximum(travel / limit, change / cell.gauge.rate).T


def tool_positions(cell: Cell, mounting: Mounting | None, start: Array, end: Array, pieces: int) -> Array:
    """Return where the tool is at equal shares of straight joint legs (m, N) [rad], (pieces + 1, m, 3) [m]."""
    q = start + np.linspace(0.0, 1.0, pieces + 1)[:, None, None] * (end - start)
    at = cell if mounting is None else cell.at(mounting)
    return at.map_position(q.reshape(-1, q.shape[2])).reshape(*q.shape[:2], 3)


def travel_and_length_change(cell: Cell, mounting: Mounting | None, x: Array) -> tuple[Array, Array]:
    """Return the tool's travel through positions x (P + 1, m, 3) [m] and the change of the gauge's length, (P, m) [m].

    Without a gauge (``mounting`` is None) there is no change.
    """
    travel = np.linalg.norm(np.diff(x, axis=0), axis=2)
    if mounting is None:
        return travel, np.zeros_like(travel)
    length = np.linalg.norm(x - cell.fixtures[mounting.fixture].p_BX, axis=2)
    return travel, np.abs(np.diff(length, axis=0))
