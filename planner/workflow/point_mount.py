"""Where the indicators of a head are mastered, or the reflector is put in: the cell's own pose, or one found here."""

from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.errors import InputError, NoSolutionError
from planner.path import Constraints
from planner.plan import settled
from planner.units import Array
from planner.workflow.mount import check_home

DRAWN = 200_000  # states among which a pose for mastering is looked for
UPRIGHT = np.deg2rad(10.0)  # tilt at which the master ball still rests in its socket


def with_mount(cell: Cell, away: Constraints, seed: int, pool: Array | None = None) -> Cell:
    """Return the cell with the pose where the session starts and ends.

    A head is mastered with its opening upwards, so that gravity holds the master ball (TriCal paper, section 3). A
    tracker is to see the reflector there: the nearest to home of the candidates ``pool`` (n, N) [rad].

    Raises:
        InputError: home or the cell's own pose breaks a constraint.
        NoSolutionError: no pose turns the head upwards.
    """
    check_home(cell, away)
    given = cell.fixtures[0].mount
    if given is not None:
        reason = away.reason(given)
        if reason is not None:
            raise InputError(f"{cell.path}: gauge.mount_deg cannot be where the session starts: {reason}")
        return cell
    found = _upright(cell, away, seed) if pool is None else pool
    seconds = (np.abs(found - cell.home) / cell.robot.speed).max(axis=1)
    mount = settled(found[int(np.argmin(seconds))])
    return replace(cell, fixtures=(replace(cell.fixtures[0], mount=mount),))


def _upright(cell: Cell, away: Constraints, seed: int) -> Array:
    robot, rng = cell.robot, np.random.default_rng([seed, 3])
    lower, upper = np.maximum(robot.q_lower, cell.home - np.pi), np.minimum(robot.q_upper, cell.home + np.pi)
    q = rng.uniform(lower, upper, (DRAWN, robot.n_joints))
    up = cell.map_axis(q) @ cell.base.R_WB[2]
    q = q[up > np.cos(UPRIGHT)]
    q = q[away.valid(q)]
    if not len(q):
        raise NoSolutionError(
            f"no collision-free pose turns the head upwards within {np.rad2deg(UPRIGHT):.0f}°, as mastering the "
            "indicators takes: give gauge.mount_deg"
        )
    return np.asarray(q)
