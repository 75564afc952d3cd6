"""Sections 2.1.3, 3.1 and 4.1 of the EDBB paper: pruning, tour, path, and circle against path."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.cell.reading import load_cell
from planner.circular.planning import plan_circles
from planner.common.progress import Stages
from planner.common.units import MM, to_mm
from planner.motion.tour.solve import solve_tour
from planner.reproduction.circle_and_path import CircleAndPath, compare_circle_and_path
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.session.tour_cost import tour_costs
from planner.workflow.planning import plan_cell

CELL, CIRCLES = "comau-nj130/paper", "comau-nj130/circular"
QUIET = Stages(lambda *_: None)


def plan_numbers() -> dict[str, Any]:
    """Plan as published and with circles, and drive both with simulated robots; numbers by their keys in the rows."""
    plan = plan_cell(load_cell(CELL), PlanOptions(as_published=True), QUIET)
    circles = plan_circles(load_cell(CIRCLES), PlanOptions(dialect=("bnr",)), QUIET)
    both = compare_circle_and_path(circles, plan, range(20))  # simulated robots
    circle_min = sum(c.duration for c in circles.courses) / 60
    path_min = sum(c.duration for c in plan.courses) / 60
    return {
        **_selection(plan), **_drive(plan), **_many_poses(plan), **_ranges(both),
        "circle_min": circle_min, "path_min": path_min, "path_by_circle": path_min / circle_min,
    }  # fmt: skip


def _selection(plan: Plan) -> dict[str, Any]:
    """Return what pruning left for each number of poses, and what exchange and the bound say."""
    choice, pruning = plan.choice, plan.choice.pruning
    assert pruning is not None
    left = pruning.left
    value = dict(zip(left.sizes.tolist(), left.values.tolist(), strict=True))
    every = choice.model.rows(plan.pool.samples)
    return {
        "candidates": len(plan.pool), "knee": left.knee, "poses": len(choice.q), "pruned_to": int(left.sizes[0]),
        "o2_22": value[22], "o2_35": value[35], "o2_100": value[100], "o2_pool": float(np.linalg.cond(every[:, 0])),
        "o2": choice.raw_indices["O2"], "exchange": pruning.exchanged, "bound": plan.certificate.value,
        "sizes": left.sizes.tolist()[:180], "curve": [float(f"{v:.4g}") for v in left.values.tolist()[:180]],
    }  # fmt: skip


def _drive(plan: Plan) -> dict[str, Any]:
    """Return what is said of tour and path."""
    (drive,) = plan.drives
    tour, path = drive.tour, drive.path
    return {
        "unsorted_s": tour.unsorted_s, "sorted_s": tour.cost_s,
        "proven": "proven" if tour.optimal else "not proven",
        "bent": sum(not leg.direct for leg in path.legs),
        "supports": int((path.node < 0).sum()), "blends": int((drive.course.measuring.blend > 0).sum()),
        "clearance_mm": float(to_mm(min(v.clearance for v in drive.verdicts))),
        "programs": ", ".join(name for name, _ in plan.programs),
    }  # fmt: skip


def _many_poses(plan: Plan) -> dict[str, Any]:
    """Return what the order gains where many pruned poses are kept."""
    assert plan.choice.pruning is not None
    count = 200
    q = plan.pool.q[plan.choice.pruning.left.choose(count)]
    tour = solve_tour(tour_costs(plan.cell, plan.cell.mountings[0], q), nodes=0)
    return {"many": count, "many_unsorted_s": tour.unsorted_s, "many_sorted_s": tour.cost_s,
            "many_ratio": tour.unsorted_s / tour.cost_s}  # fmt: skip


def _ranges(both: Sequence[CircleAndPath]) -> dict[str, Any]:
    """Return medians and the 5 to 95 % of what circle and path use and show, and how many times more the path shows."""
    out: dict[str, Any] = {}
    for which in ("circle", "path"):
        for what in ("length", "deviation"):
            values = np.array([getattr(getattr(c, which), what) for c in both]) / MM
            low, middle, high = np.percentile(values, [5, 50, 95])
            out |= {f"{which}_{what}_mm": middle, f"{which}_{what}_low_mm": low, f"{which}_{what}_high_mm": high}
    out["times"] = float(np.median([c.path.deviation / c.circle.deviation for c in both]))
    return out
