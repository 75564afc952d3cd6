"""Section 4.1 of the EDBB paper: what a circle uses and shows of a robot's errors, and what the chosen path does."""

import numpy as np

from planner.cell.reading import load_cell
from planner.common.progress import Stages
from planner.instruments.circular.planning import plan_circles
from planner.session.options import PlanOptions
from planner.workflow.planning import plan_cell
from tests.reproduction.comparison import PAPER, compare_circle_and_path

ROBOTS = 20


def compared():
    """Rows (what, published, median, range) [mm] over drawn robots."""
    stages, options = Stages(lambda *_: None), PlanOptions(dialect=("bnr",))
    circles = plan_circles(load_cell("comau-nj130/circular"), options, stages)
    path = plan_cell(load_cell("comau-nj130/paper"), options, stages)
    each = compare_circle_and_path(circles, path, range(ROBOTS))
    rows = []
    for which, name in (("circle", "circle"), ("path", "error-sensitive path")):
        for what, words in (("length", "range of length used (mm)"), ("deviation", "range of deviation (mm)")):
            values = 1e3 * np.array([getattr(getattr(c, which), what) for c in each])
            low, middle, high = np.percentile(values, [5, 50, 95])
            published = 1e3 * getattr(getattr(PAPER, which), what)
            rows.append((f"{name}, {words}", f"{published:.2f}", f"{middle:.2f}", f"{low:.1f} to {high:.1f}"))
    return rows
