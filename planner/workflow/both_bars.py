"""``plan_both()``: poses without load and circles under load that know geometry and compliances best in one fit."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.cell.circles import Circle
from planner.cell.file import CellFile
from planner.cell.reading import load_cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.files import draft_folder, move_all, write_bytes, write_text
from planner.common.progress import Stages
from planner.common.result import Result
from planner.common.schema import validate
from planner.common.units import Array, read_only, to_mm
from planner.instruments.circular.arc import plan_arc
from planner.instruments.circular.plan import Arc, CircularPlan
from planner.instruments.circular.planning import plan_circles
from planner.instruments.loaded.results import share_text
from planner.motion.path.constraints import Constraints
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.studies.compliance_design.circle_candidates import ANGLES, CirclePlace, find_circle_places
from planner.studies.compliance_design.common_fit import (
    CommonFit,
    check_robots,
    has_same_tool,
    predict_common_fit,
    select_circles_beside,
)
from planner.studies.compliance_design.results import common_fit_content, describe_common_fit
from planner.workflow.loaded_places import FITTED, UnloadedPoses, load_unloaded_poses, with_circles
from planner.workflow.planning import plan_cell
from planner.workflow.writing import cell_text, write_circular_plan, write_plan

ROUNDS = 6  # choices of places, each without those that the one before could not drive


@dataclass(frozen=True)
class BothPlan(Result):
    """A session with both bars.

    Attributes:
        unloaded: the plan without load; ``None`` where it was there already, at ``source``.
        free: its poses and cell.
        loaded: the circles at the chosen places.
        known: what each kind of run alone, and one fit of both, would know.
    """

    source: Path | None
    unloaded: Plan | None
    free: UnloadedPoses
    loaded: CircularPlan
    known: CommonFit
    stages: Stages = field(default_factory=Stages)

    def summary(self) -> str:
        """Return what is measured, and what each bar alone and one fit of both would know."""
        known = self.known
        minutes = sum(d.duration for d in self.loaded.drives) / 60
        lines = [
            f"{self.loaded.cell.robot.name}: {len(self.free.q)} poses without load, {len(self.arcs)} loaded circles"
        ]
        for arc in self.arcs:
            circle = arc.circle
            centre = ", ".join(f"{v:.0f}" for v in to_mm(circle.p_BC))
            lines.append(f"  {circle.name:<12}{circle.plane} about [{centre}] mm; {arc.told}")
        lines.append(f"  {'path':<12}{minutes:.1f} min with the loaded bar on, proven as every plan is")
        lines.append(
            f"  {'predicted':<12}{'':<14}{'without load':>14}{'circles':>12}{'one fit':>12}   of the prior size"
        )
        for name, *parts in known.of("compliance"):
            first, second, both = (share_text(float(v)) for v in parts)
            lines.append(f"  {'':<12}{name:<14}{first:>14}{second:>12}{both:>12}")
        lines += [f"  found       {s}" for s in describe_common_fit(known)]
        lines += [f"  {k + 1}.{'':<10}{text}" for k, text in enumerate(both_session_steps(self))]
        return "\n".join([*lines, *(f"  note        {note}" for note in self.loaded.notes)])

    def content(self) -> Mapping[str, Any]:
        """Return what ``both.json`` says."""
        return both_record(self)

    def write(self, folder: Path | str) -> list[Path]:
        """Write ``unloaded/`` and ``loaded/``, each a whole plan, ``cell.toml`` of the fit and ``both.json``."""
        return write_both(self, Path(folder), self.stages)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        new = f"{UNLOADED}/, " if self.unloaded is not None else ""
        return f"{new}{LOADED}/, cell.toml, both.json, pictures"

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """The loaded circles as they are driven."""
        return tuple(a for d in self.loaded.drives for a in d.arcs)


def plan_both(unloaded: str, loaded: str, places: int, options: PlanOptions, stages: Stages) -> BothPlan:
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
    there = load_unloaded_poses(source) if source else None
    free_cell = there.cell if there else load_cell(unloaded)
    _check(free_cell, cell)
    with stages.stage("places"):
        pool = collision_free_places(cell, find_circle_places(cell, options.seed))
    if places > len(pool):
        raise NoSolutionError(
            f"{cell.path}: {places} places were asked for, but only {len(pool)} circles can be driven without collision"
        )
    made = None if there else plan_cell(free_cell, options, stages)
    free = there or _unloaded_poses(made)
    driven = _choose_drivable(cell, free, pool, places, options, stages)
    known = predict_common_fit(free.cell, free.q, free.fixture, cell, _driven_candidates(driven))
    return BothPlan(source, made, free, driven, known, stages)


def collision_free_places(cell: Cell, pool: Sequence[CirclePlace]) -> tuple[CirclePlace, ...]:
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


def _choose_drivable(
    cell: Cell, free: UnloadedPoses, pool: Sequence[CirclePlace], places: int, options: PlanOptions, stages: Stages
) -> CircularPlan:
    """Choose places and plan their circles; a place that cannot be driven after all is left out and chosen anew."""
    for _ in range(ROUNDS):
        with stages.stage("choice"):
            which = select_circles_beside(free.cell, free.q, free.fixture, cell, pool, places)
        there = with_circles(cell, [pool[int(i)] for i in which])
        starts = {c.name: _start(c, pool[int(i)]) for c, i in zip(there.circles, which, strict=True)}
        try:
            return plan_circles(there, options, stages, starts)
        except NoSolutionError as err:
            lost = {int(i) for i in which if not _is_drivable(cell, pool[int(i)], options.seed)}
            if not lost or len(pool) - len(lost) < places:
                raise err
            pool = [c for i, c in enumerate(pool) if i not in lost]
    raise NoSolutionError(
        f"{cell.path}: in {ROUNDS} choices of {places} places there was each time one that cannot be driven; ask for "
        "fewer --places, or lower motion.clearance_mm"
    )


def _start(circle: Circle, place: CirclePlace) -> Array:
    """Where the way round that was looked at begins, before its overshoot, (N,) [rad]."""
    return np.asarray(place.q[round(-circle.overshoot / (2 * np.pi) * ANGLES) % ANGLES])


def _is_drivable(cell: Cell, place: CirclePlace, seed: int) -> bool:
    there = with_circles(cell, [place])
    try:
        plan_arc(there, there.circles[0], seed)
    except NoSolutionError:
        return False
    return True


def _driven_candidates(plan: CircularPlan) -> list[CirclePlace]:
    """The circles of a plan, in the way round that it drives."""
    out = []
    for arc in (a for d in plan.drives for a in d.arcs):
        circle, fixture = arc.circle, plan.cell.fixtures[arc.circle.fixture]
        theta = circle.start + np.arange(ANGLES) * 2 * np.pi / ANGLES
        q = np.stack([np.interp(theta, arc.angle, column) for column in arc.q.T], axis=1)
        side = 1 if (circle.p_BC - fixture.p_BX) @ circle.normal >= 0 else -1
        out.append(CirclePlace(circle.plane, side, circle.p_BC, fixture.p_BX, fixture.axis_B, read_only(q)))
    return out


def _unloaded_poses(made: Plan | None) -> UnloadedPoses:
    """What a finished plan measures for the fit."""
    assert made is not None
    visits = [v for d in made.drives for v in d.visits if v.role in FITTED]
    return UnloadedPoses(made.cell, np.array([v.q for v in visits]), np.array([v.fixture for v in visits]))


def _check(free_cell: Cell, cell: Cell) -> None:
    check_robots(free_cell, cell)
    if not free_cell.gauge.is_attached or free_cell.circles:
        what = "circles" if free_cell.circles else f"a gauge '{free_cell.gauge.kind}'"
        raise InputError(f"{free_cell.path}: has {what}; the first cell is that of a bar without load, 'edbb'")
    if not has_same_tool(free_cell, cell):
        raise InputError(
            f"{free_cell.path} and {cell.path} differ in [tool]; one fit needs one tool: both bars hang from the same "
            "ball (map_mm), and the arm carries the same mass_kg at com_mm"
        )
    if not np.allclose(free_cell.base.R_WB, cell.base.R_WB):
        raise InputError(f"{free_cell.path} and {cell.path} differ in base.rpy_deg; the robot stands in one way only")


UNLOADED, LOADED = "unloaded", "loaded"  # folders of the two plans


def write_both(done: BothPlan, folder: Path, stages: Stages) -> list[Path]:
    """Write ``unloaded/`` and ``loaded/``, each a whole plan, ``cell.toml`` of the fit, ``both.json``, its picture."""
    from planner.report.matplotlib_backend import chart_png as picture_png

    # plotting: other commands start quicker without
    from planner.studies.compliance_design.pictures import draw_common_fit as known_by_both

    with draft_folder(folder) as draft:
        if done.unloaded is not None:
            write_plan(done.unloaded, draft / UNLOADED, stages)
        write_circular_plan(done.loaded, draft / LOADED, stages)
        with stages.stage("report"):
            write_text(draft / "cell.toml", cell_text(fit_cell(done.free.cell, done.loaded.cell), draft))
            write_text(draft / "both.json", both_text(done))
            (draft / "pictures").mkdir()
            write_bytes(draft / "pictures" / "known.png", picture_png(known_by_both(done.known)))
            return move_all(draft, folder)


def both_text(done: BothPlan) -> str:
    """Return ``both.json``."""
    return json.dumps(both_record(done), indent=1, ensure_ascii=False) + "\n"


def both_record(done: BothPlan) -> dict[str, object]:
    """Return the content of ``both.json``."""
    poses, circles = len(done.free.q), [a.circle.name for a in done.arcs]
    return common_fit_content(done.known, done.loaded.cell.robot.name, poses, circles, both_session_steps(done))


def both_session_steps(done: BothPlan) -> tuple[str, ...]:
    """Say in which order everything is done, and with which files."""
    first = f"{done.source.parent.name}/{done.source.name}" if done.source is not None else UNLOADED
    return (
        f"the bar without load: the program of {first}, its log is the run FREE.csv",
        f"the loaded bar: the program of {LOADED}, which tells where it stands and when the load changes; its log with "
        "force_N is the run LOADED.csv",
        "both in one fit: edbb loaded LOADED.csv --with FREE.csv --cell cell.toml -o DIR",
        "the corrected robot: edbb identify DIR/joint.csv --cell cell.toml -o CALIBRATED",
    )


def fit_cell(free: Cell, loaded: Cell) -> Cell:
    """Return the cell of the common fit: the loaded circles, all fixtures, a gauge that reaches as far as both bars."""
    content = loaded.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    other = free.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    content["fixtures"] += [{k: v for k, v in f.items() if k != "mount_deg"} for f in other["fixtures"]]
    gauges = content["gauge"], other["gauge"]
    lengths = [length for g in gauges for length in g["length_mm"]]
    content["gauge"] |= {
        "length_mm": [min(lengths), max(lengths)],
        "noise_um": max(g.get("noise_um", 1.0) for g in gauges),
    }
    return replace(loaded, file=validate(content, CellFile, str(loaded.path)))
