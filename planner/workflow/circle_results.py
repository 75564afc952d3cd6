"""The plan of a circular test: how it is made, read again, and given to a person."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from planner.cell.cell import Cell
from planner.circular.document import CircularDocument, circular_document, load_circular_plan
from planner.circular.plan import CircularPlan, circle_samples
from planner.common.console import as_word
from planner.common.errors import InputError
from planner.common.numbers import number_of
from planner.common.progress import Stages
from planner.common.summary import Fact, Summary
from planner.common.units import to_deg, to_mm
from planner.motion.collision.body_gaps import clearance_text
from planner.runs.run import Samples
from planner.session.evaluations import evaluation_of
from planner.session.options import PlanOptions
from planner.workflow.plan_results import SessionResult

if TYPE_CHECKING:
    from planner.report.page import Report


@dataclass(frozen=True)
class CircularPlanResult(SessionResult):
    """A planned circular test.

    Attributes:
        plan: circles, drives and programs.

    Example:
        >>> plan("comau-nj130/circular").write("circles")  # doctest: +SKIP
    """

    kind = "circular"
    one_clock = True
    plan: CircularPlan

    def document(self) -> CircularDocument:
        """Return what ``plan.json`` holds."""
        return circular_document(self.plan)

    def report(self) -> Report:
        """Return the page of the plan and its pictures."""
        from planner.report.circular_report import report_circular_plan  # plotting: others start quicker without

        return report_circular_plan(self.plan)

    def overview(self) -> Summary:
        """Return the overview of the drive."""
        return circular_overview(self.plan)

    def next_step(self, folder: Path) -> str:
        """Say how the circles are measured and evaluated."""
        plan = folder / "plan.json"
        measure = self.plan.cell.gauge.measuring_command.replace("PLAN", as_word(plan))
        return f"{measure}\n{evaluation_of('run.csv', plan, self.kind, calibrates=False)}"


def circular_overview(plan: CircularPlan) -> Summary:
    """Return the overview of a circular test."""
    arcs = plan.arcs
    minutes = sum(c.duration for c in plan.courses) / 60
    facts: list[Fact] = []
    for a in arcs:
        c = a.circle
        loads = f", {len(c.loads)} loads" if c.loads else ""
        bar = f"bar {to_mm(a.length.min()):.1f} to {to_mm(a.length.max()):.1f} mm"
        sweep = f"{to_deg(c.sweep):g}° from {to_deg(c.start):g}°, {' and '.join(c.directions)}{loads}"
        facts.append((c.name, f"{c.plane}, radius {to_mm(c.radius):g} mm, {sweep}, {to_mm(c.speed):.4g} mm/s; {bar}"))
        facts.append(("", a.told))
    clearance = min(v.clearance for v in plan.verdicts)
    facts.append(("drive", f"{minutes:.0f} min; {clearance_text(plan.cell, clearance)}"))
    count = number_of(len(arcs), "circle")
    return Summary(f"{plan.cell.name}: circular test on {count}, plan {plan.plan_id}", facts, notes=plan.notes)


class CircularMaker:
    """Plans the circles of a cell, and reads their plans."""

    def plan(self, cell: Cell, options: PlanOptions, stages: Stages) -> CircularPlanResult:
        """Plan the circular test of a cell, as :func:`.plan_circles` does."""
        from planner.circular.planning import plan_circles  # needless to read a plan, and slow to load

        _check_options(cell, options)
        return CircularPlanResult(plan_circles(cell, options, stages), stages)

    def load(self, path: Path) -> CircularPlan:
        """Read the plan at a path with the cell beside it."""
        return load_circular_plan(path)

    def samples(self, plan: CircularPlan, rate: float) -> Samples:
        """Return where the arm is told to stand while the passes are driven, ``rate`` times a second."""
        return circle_samples(plan, rate)


def _check_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a circular test that only a choice of poses can give.

    Raises:
        InputError: with the options to leave out.
    """
    of_choice = [f.name for f in fields(PlanOptions) if f.default is None]
    given = ", ".join(f"--{name.replace('_', '-')}" for name in of_choice if getattr(options, name) is not None)
    if given:
        raise InputError(f"{cell.path}: a circular test has no poses to be chosen; leave out {given}")
