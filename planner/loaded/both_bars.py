"""Circles under load chosen beside poses without load: those that one fit of both gains most from, and their plan."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.circular.circle import Circle, circles_of
from planner.circular.plan import CircularPlan
from planner.circular.planning import plan_arc, plan_circles
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages
from planner.common.units import Array, read_only
from planner.loaded.circle_candidates import FOLLOWED_ANGLES, CirclePlace, with_circles
from planner.loaded.common_fit import UnloadedPoses, check_robots, has_same_tool, select_circles_beside
from planner.motion.path.constraints import Constraints
from planner.session.options import PlanOptions


def collision_free_places(cell: Cell, pool: Sequence[CirclePlace]) -> tuple[CirclePlace, ...]:
    """Return the places where arm and bar, on the way round that was looked at, meet nothing.

    Raises:
        NoSolutionError: there is none.
    """
    out = []
    for c in pool:
        there = Constraints(with_circles(cell, [c]))
        if not there.world.find_near(c.q, there.clearance).any():
            out.append(c)
    if not out:
        raise NoSolutionError(
            f"{cell.path}: on all {len(pool)} circles that the arm can follow it collides: lower motion.clearance_mm, "
            "or check obstacles, the bodies of tool and bar, and base.floor_mm"
        )
    return tuple(out)


def plan_circles_beside(
    cell: Cell, free: UnloadedPoses, pool: Sequence[CirclePlace], places: int, options: PlanOptions, stages: Stages
) -> CircularPlan:
    """Choose places and plan their circles; a place that cannot be driven after all is left out and chosen anew.

    Raises:
        NoSolutionError: so many places cannot be driven.
    """
    most_choices = 6  # of places, each without those that the one before could not drive
    for _ in range(most_choices):
        with stages.stage("choice"):
            which = select_circles_beside(free, cell, pool, places)
        there = with_circles(cell, [pool[int(i)] for i in which])
        starts = {c.name: _start(c, pool[int(i)]) for c, i in zip(circles_of(there), which, strict=True)}
        try:
            return plan_circles(there, options, stages, starts)
        except NoSolutionError as err:
            lost = {int(i) for i in which if not _is_drivable(cell, pool[int(i)], options.seed)}
            if not lost or len(pool) - len(lost) < places:
                raise err
            pool = [c for i, c in enumerate(pool) if i not in lost]
    raise NoSolutionError(
        f"{cell.path}: in {most_choices} choices of {places} places there was each time one that cannot be driven; "
        "ask for fewer --places, or lower motion.clearance_mm"
    )


def _start(circle: Circle, place: CirclePlace) -> Array:
    """Where the way round that was looked at begins, before its overshoot, (N,) [rad]."""
    return np.asarray(place.q[round(-circle.overshoot / (2 * np.pi) * FOLLOWED_ANGLES) % FOLLOWED_ANGLES])


def _is_drivable(cell: Cell, place: CirclePlace, seed: int) -> bool:
    there = with_circles(cell, [place])
    try:
        plan_arc(there, circles_of(there)[0], seed)
    except NoSolutionError:
        return False
    return True


def driven_places(plan: CircularPlan) -> list[CirclePlace]:
    """The circles of a plan, in the way round that it drives."""
    out = []
    for arc in plan.arcs:
        circle = arc.circle
        theta = circle.start + np.arange(FOLLOWED_ANGLES) * 2 * np.pi / FOLLOWED_ANGLES
        q = np.stack([np.interp(theta, arc.angle, column) for column in arc.q.T], axis=1)
        out.append(CirclePlace(circle, plan.cell.fixtures[circle.fixture].p_BX, read_only(q)))
    return out


def check_both_cells(free_cell: Cell, cell: Cell) -> None:
    """Refuse two cells that no one fit can be made of.

    Raises:
        InputError: they differ in robot, tool or base, or the first is not one of a bar without load.
    """
    check_robots(free_cell, cell)
    free_cell.require_bar("the first cell is that of a bar without load, 'edbb'", free=True)
    if not has_same_tool(free_cell, cell):
        raise InputError(
            f"{free_cell.path} and {cell.path} differ in [tool]; one fit needs one tool: both bars hang from the same "
            "ball (map_mm), and the arm carries the same mass_kg at com_mm"
        )
    if not np.allclose(free_cell.base.R_WB, cell.base.R_WB):
        raise InputError(f"{free_cell.path} and {cell.path} differ in base.rpy_deg; the robot stands in one way only")
