"""The EDBB paper's method beside the default: poses, condition number, minutes and processor time of four cells."""

import os
from typing import Any

from planner.cell.reading import load_cell
from planner.common.progress import Stages
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.workflow.planning import plan_cell

CELLS = ("comau-nj130/paper", "comau-nj130/edbb", "ur10/edbb", "abb-irb6700/edbb")
METHODS = {"default": PlanOptions(), "as published": PlanOptions(as_published=True)}
QUIET = Stages(lambda *_: None)


def method_numbers() -> dict[str, Any]:
    """Plan four cells by both methods; one row each, in ``rows``."""
    return {"rows": [row_of_plan(cell, method) for cell in CELLS for method in METHODS]}


def row_of_plan(cell: str, method: str) -> dict[str, Any]:
    """Plan one cell by one method and return its row."""
    begun = _processor_seconds()
    plan = plan_cell(load_cell(cell), METHODS[method], QUIET)
    return {"cell": cell, "method": method, **_figures(plan), "processor_s": _processor_seconds() - begun}


def _processor_seconds() -> float:
    """Return the processor time of this process and of those that it has begun [s]."""
    return sum(os.times()[:4])


def _figures(plan: Plan) -> dict[str, Any]:
    return {
        "poses": len(plan.choice.q),
        "o2": plan.choice.raw_indices["O2"],
        "minutes": sum(c.duration for c in plan.courses) / 60,
        "supports": sum(int((d.path.node < 0).sum()) for d in plan.drives),
    }
