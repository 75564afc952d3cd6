"""Where the bar is attached, and whether the robot can stand at home at all."""

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.errors import InputError
from planner.path import Constraints
from planner.tour import slowest_axis_cost
from planner.units import Array


def check_home(cell: Cell, without_bar: Constraints) -> None:
    """Refuse a home where the robot itself collides.

    Raises:
        InputError: naming the two bodies or the limit.
    """
    reason = without_bar.reason(cell.home)
    if reason is not None:
        raise InputError(f"{cell.path}: home_deg cannot be the start pose: {reason}")


def mount_pose(cell: Cell, fixture: int, constraints: Constraints, pool: PoseSet) -> Array:
    """Return where the bar is attached, (N,) [rad]: the cell's own, else the candidate quickest to reach from home.

    Raises:
        InputError: the cell's mount pose breaks a constraint.
    """
    mount = cell.gauge.mount
    if mount is not None:
        reason = constraints.reason(mount)
        if reason is not None and len(cell.fixtures) == 1:
            raise InputError(f"{cell.path}: gauge.mount_deg cannot hold the bar: {reason}")
        if reason is None:
            return mount
    here = pool.q[pool.fixture == fixture]
    seconds = np.abs(here - cell.home) / cell.robot.speed
    return np.asarray(here[int(np.argmin(seconds.max(axis=1)))])


def costs(cell: Cell, nodes: Array) -> Array:
    """Slowest-axis times between nodes (n, N) [rad], (n, n) [s]."""
    return slowest_axis_cost(nodes, cell.robot.speed)
