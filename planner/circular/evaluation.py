"""From a run to the figures of every circle that was measured in it."""

from dataclasses import dataclass

from planner.cell import Cell
from planner.circular.figures import CircleFigures, circle_figures
from planner.circular.file import CircularPlanFile
from planner.circular.measured import rings_of, traces_of
from planner.errors import InputError
from planner.run import Run


@dataclass(frozen=True)
class CircularTest:
    """A measured circular test: plan, run and robot by name, the figures of its circles, what a person should know."""

    plan_id: str
    run: str
    robot: str
    circles: tuple[CircleFigures, ...]
    warnings: tuple[str, ...]

    @property
    def length_range(self) -> float:
        """Range of the bar's length that all circles together use [m]."""
        return max(c.length_range for c in self.circles)


def evaluate_circles(cell: Cell, plan: CircularPlanFile, run: Run) -> CircularTest:
    """Evaluate the run of a circular test.

    Raises:
        InputError: the run belongs to another plan or robot, or holds no whole sweep.
    """
    if plan.robot != cell.robot.name:
        raise InputError(f"the plan is one for {plan.robot}, but {cell.path} is a cell of {cell.robot.name}")
    if run.plan_id not in (None, plan.plan_id):
        raise InputError(f"{run.name} belongs to plan {run.plan_id}, but the plan given is {plan.plan_id}")
    rings = rings_of(cell, plan.circles)
    traces = traces_of(cell, rings, run)
    keys = sorted({(t.ring, t.load or 0.0) for t in traces})
    circles = []
    for k, load in keys:
        mine = [t for t in traces if (t.ring, t.load or 0.0) == (k, load)]
        circles.append(circle_figures(rings[k], mine[0].load, mine))
    return CircularTest(plan.plan_id, run.name, cell.robot.name, tuple(circles), _warnings(cell, plan, run, circles))


def _warnings(cell: Cell, plan: CircularPlanFile, run: Run, circles: list[CircleFigures]) -> tuple[str, ...]:
    out = list(run.warnings)
    for c in plan.circles:
        mine = [f for f in circles if f.ring.name == c.name]
        driven = {p.direction for f in mine for p in f.paths}
        missing = [d for d in c.directions if d not in driven]
        if not mine:
            out.append(f"circle {c.name} is not in the run")
        elif missing:
            out.append(f"circle {c.name}: no whole sweep {missing[0]} in the run")
        if mine and c.sweep_deg < 360.0:
            std = max(float(f.centre.std.max()) for f in mine)
            out.append(
                f"circle {c.name} is a part of a circle: its centre, and with it what is left, is less well known "
                f"({1e6 * std:.1f} µm)"
            )
    if cell.gauge.zero_free:
        out.append("the bar's zero is not known: the mean radial deviation holds that zero's error as well")
    if run.samples.q_read is None and run.samples.q_cmd is not None:
        out.append("the run has no joint angles as read: angles along the circles are those commanded")
    return tuple(out)
