"""``plan_both()``: poses without load and circles under load that know geometry and compliances best in one fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.cell import Cell, Circle, load_cell
from planner.circular import Arc, CircularPlan, plan_arc
from planner.errors import InputError, NoSolutionError
from planner.path import Constraints
from planner.plan import Plan
from planner.study.softness import Both, Candidate, candidates, choose_beside, predicted_both
from planner.study.softness.both import check_robots, one_tool
from planner.study.softness.circles import ANGLES
from planner.units import Array, frozen
from planner.workflow.circling import plan_circles
from planner.workflow.loaded_places import FITTED, Unloaded, unloaded_plan, with_circles
from planner.workflow.plan import plan
from planner.workflow.planning import Options, Stages

ROUNDS = 6  # choices of places, each without those that the one before could not drive


@dataclass(frozen=True)
class BothPlan:
    """A session with both bars.

    Attributes:
        unloaded: the plan without load; ``None`` where it was there already, at ``source``.
        free: its poses and cell.
        loaded: the circles at the chosen places.
        known: what each kind of run alone, and one fit of both, would know.
    """

    source: Path | None
    unloaded: Plan | None
    free: Unloaded
    loaded: CircularPlan
    known: Both

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """The loaded circles as they are driven."""
        return tuple(a for d in self.loaded.drives for a in d.arcs)


def plan_both(unloaded: str, loaded: str, places: int, options: Options, stages: Stages) -> BothPlan:
    """Plan a session with an unloaded and a loaded bar.

    Args:
        unloaded: cell of the bar without load, or the ``plan.json`` of one that is planned already.
        loaded: cell with the loaded circle; radius, loads and repeats are taken from it.
        places: how many circles; ``options`` are those of both plans.
        stages: what is told meanwhile.

    Raises:
        InputError: the cells do not belong together, or ask for what cannot be.
        NoSolutionError: a stage has no solution; the message says which.
    """
    cell = load_cell(loaded)
    source = Path(unloaded) if unloaded.endswith(".json") else None
    there = unloaded_plan(source) if source else None
    free_cell = there.cell if there else load_cell(unloaded)
    _check(free_cell, cell)
    with stages.stage("places"):
        pool = clear_places(cell, candidates(cell, options.seed))
    if places > len(pool):
        raise NoSolutionError(
            f"{cell.path}: {places} places were asked for, but only {len(pool)} circles can be driven without collision"
        )
    made = None if there else plan(free_cell, options, stages)
    free = there or _poses_of(made)
    driven = _drivable(cell, free, pool, places, options, stages)
    known = predicted_both(free.cell, free.q, free.fixture, cell, _as_driven(driven))
    return BothPlan(source, made, free, driven, known)


def clear_places(cell: Cell, pool: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return the places where arm and bar, on the way round that was looked at, meet nothing.

    Raises:
        NoSolutionError: there is none.
    """
    out = []
    for c in pool:
        there = Constraints(with_circles(cell, [c]))
        if not there.world.near(c.q, there.clearance).any():
            out.append(c)
    if not out:
        raise NoSolutionError(
            f"{cell.path}: on all {len(pool)} circles that the arm can follow it collides: lower motion.clearance_mm, "
            "or check obstacles, the bodies of tool and bar, and base.floor_mm"
        )
    return tuple(out)


def _drivable(
    cell: Cell, free: Unloaded, pool: Sequence[Candidate], places: int, options: Options, stages: Stages
) -> CircularPlan:
    """Choose places and plan their circles; a place that cannot be driven after all is left out and chosen anew."""
    for _ in range(ROUNDS):
        with stages.stage("choice"):
            which = choose_beside(free.cell, free.q, free.fixture, cell, pool, places)
        there = with_circles(cell, [pool[int(i)] for i in which])
        starts = {c.name: _start(c, pool[int(i)]) for c, i in zip(there.circles, which, strict=True)}
        try:
            return plan_circles(there, options, stages, starts)
        except NoSolutionError as err:
            lost = {int(i) for i in which if not _goes(cell, pool[int(i)], options.seed)}
            if not lost or len(pool) - len(lost) < places:
                raise err
            pool = [c for i, c in enumerate(pool) if i not in lost]
    raise NoSolutionError(
        f"{cell.path}: in {ROUNDS} choices of {places} places there was each time one that cannot be driven; ask for "
        "fewer --places, or lower motion.clearance_mm"
    )


def _start(circle: Circle, place: Candidate) -> Array:
    """Where the way round that was looked at begins, before its overshoot, (N,) [rad]."""
    return np.asarray(place.q[round(-circle.overshoot / (2 * np.pi) * ANGLES) % ANGLES])


def _goes(cell: Cell, place: Candidate, seed: int) -> bool:
    there = with_circles(cell, [place])
    try:
        plan_arc(there, there.circles[0], seed)
    except NoSolutionError:
        return False
    return True


def _as_driven(plan: CircularPlan) -> list[Candidate]:
    """The circles of a plan, in the way round that it drives."""
    out = []
    for arc in (a for d in plan.drives for a in d.arcs):
        circle, fixture = arc.circle, plan.cell.fixtures[arc.circle.fixture]
        theta = circle.start + np.arange(ANGLES) * 2 * np.pi / ANGLES
        q = np.stack([np.interp(theta, arc.angle, column) for column in arc.q.T], axis=1)
        side = 1 if (circle.p_BC - fixture.p_BX) @ circle.normal >= 0 else -1
        out.append(Candidate(circle.plane, side, circle.p_BC, fixture.p_BX, fixture.axis_B, frozen(q)))
    return out


def _poses_of(made: Plan | None) -> Unloaded:
    """What a finished plan measures for the fit."""
    assert made is not None
    visits = [v for d in made.drives for v in d.visits if v.role in FITTED]
    return Unloaded(made.cell, np.array([v.q for v in visits]), np.array([v.fixture for v in visits]))


def _check(free_cell: Cell, cell: Cell) -> None:
    check_robots(free_cell, cell)
    if not free_cell.gauge.is_bar or free_cell.circles:
        what = "circles" if free_cell.circles else f"a gauge '{free_cell.gauge.kind}'"
        raise InputError(f"{free_cell.path}: has {what}; the first cell is that of a bar without load, 'edbb'")
    if not one_tool(free_cell, cell):
        raise InputError(
            f"{free_cell.path} and {cell.path} differ in [tool]; one fit needs one tool: both bars hang from the same "
            "ball (map_mm), and the arm carries the same mass_kg at com_mm"
        )
    if not np.allclose(free_cell.base.R_WB, cell.base.R_WB):
        raise InputError(f"{free_cell.path} and {cell.path} differ in base.rpy_deg; the robot stands in one way only")
