"""A small plan whose drive is proven: a few poses that straight joint motions join, from home and back."""

from functools import cache

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.units import Array, round_angles
from planner.design.candidates.pool import draw_candidates
from planner.motion.path.constraints import Constraints
from planner.runs.run import FIRST_MOUNTING
from planner.session.course import Course, Waypoints, time_course

CANDIDATES = 400
APART = 0.3  # [rad] between any two poses, by the joint that turns furthest


@cache
def proven_tour(name: str, count: int) -> Array:
    """Return a mount pose, ``count`` others and the mount pose again (count + 2, N) [rad], joined by proven legs."""
    cell = load_cell(name)
    pool = round_angles(draw_candidates(cell, CANDIDATES, 0).q)
    without = Constraints(cell, bar=False)
    reached = without.prove(np.broadcast_to(cell.home, pool.shape), pool).proven
    for mount in pool[reached]:
        held = Constraints(cell.with_mount(FIRST_MOUNTING, mount))
        tour = [mount]
        for q in pool:
            apart = min(np.abs(q - other).max() for other in tour) > APART
            if len(tour) <= count and apart and all(held.prove(a[None], q[None]).proven[0] for a in (tour[-1], mount)):
                tour.append(q)
        if len(tour) == count + 1:
            return np.array([*tour, mount])
    raise AssertionError("no proven tour")


def small_course(cell: Cell, tour: Array) -> Course:
    """Return the course through a tour, at rest at every pose."""
    travel = round_angles(np.array([cell.home, tour[0]]))
    ids = np.array([*range(len(tour))])
    return time_course(
        cell,
        FIRST_MOUNTING,
        Waypoints(travel, np.array([-1, 0]), np.zeros(2)),
        Waypoints(tour, ids, np.zeros(len(tour))),
    )
