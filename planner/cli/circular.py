"""The commands of circular tests: plan them, evaluate them."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cell import Cell
from planner.circular import CircularPlan, CircularTest, circular_content
from planner.circular.results import circular_test_content
from planner.cli.options import Json, Output, check_folder, print_json
from planner.cli.screen import Screen, errors
from planner.cli.written import written_line
from planner.units import UM, to_deg, to_mm
from planner.workflow import Options
from planner.workflow.asked import check_for_circles
from planner.workflow.circle_evaluating import evaluate_circular_runs, write_circular_test
from planner.workflow.circle_writing import write_circular_plan
from planner.workflow.circling import plan_circles


def plan_circular_test(cell: Cell, output: Path, options: Options, as_json: bool) -> None:
    """Plan the ``[[circles]]`` of a cell and write all that belongs to it."""
    check_for_circles(cell, options)
    with Screen() as stages:
        result = plan_circles(cell, options, stages)
        write_circular_plan(result, output, stages)
    if as_json:
        print_json(circular_content(result))
    else:
        circular_summary(result, output)


def circular_summary(plan: CircularPlan, folder: Path) -> None:
    """Say in a few lines what is driven and where it lies."""
    arcs = [a for d in plan.drives for a in d.arcs]
    verdicts = [v for d in plan.drives for part in (*(a.verdicts for a in d.arcs), d.verdicts) for v in part]
    lines = [
        f"{plan.cell.name}: circular test on {len(arcs)} circle{'s' if len(arcs) > 1 else ''}, plan {plan.plan_id}"
    ]
    for a in arcs:
        c = a.circle
        loads = f", {len(c.loads)} loads" if c.loads else ""
        bar = f"bar {to_mm(a.length.min()):.1f} to {to_mm(a.length.max()):.1f} mm"
        sweep = f"{to_deg(c.sweep):g}° from {to_deg(c.start):g}°, {' and '.join(c.directions)}{loads}"
        lines.append(
            f"  {c.name:<10}  {c.plane}, radius {to_mm(c.radius):g} mm, {sweep}, {to_mm(c.speed):.4g} mm/s; {bar}"
        )
        lines.append(f"  {'':<10}  {a.told}")
    lines.append(
        f"  path        {to_mm(min(v.clearance for v in verdicts)):.1f} mm clearance, proven continuously by coal and "
        f"judged again by fcl; {sum(d.duration for d in plan.drives) / 60:.1f} min with the bar on"
    )
    lines += [f"  note        {note}" for note in plan.notes]
    lines.append(written_line(folder, [f.name for _, files in plan.programs for f in files]))
    errors.print("\n".join(lines), markup=False)


def circular_command(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="measured runs, .csv or .parquet")],
    plan: Annotated[
        Path, typer.Option(metavar="PLAN.json", help="the circular test that was measured, its cell.toml beside it")
    ],
    output: Output,
    as_json: Json = False,
) -> None:
    """Evaluate a circular test in the manner of ISO 230-4: deviations, reversals, the polar plot."""
    check_folder(output)
    with Screen() as stages:
        found = evaluate_circular_runs(runs, plan, stages)
        write_circular_test(found, output, stages)
    if as_json:
        print_json(circular_test_content(found))
    else:
        _test_summary(found, output)


def _test_summary(test: CircularTest, folder: Path) -> None:
    lines = [f"{test.run}: circular test of {test.robot}, plan {test.plan_id}"]
    for c in test.circles:
        name = c.ring.name if c.load is None else f"{c.ring.name} {c.load:g} N"
        each = "  ".join(f"G({p.direction}) {p.G / UM:.1f}" for p in c.paths)
        both = "" if c.G_b is None or c.H is None else f"  G(b) {c.G_b / UM:.1f}  H {c.H / UM:.1f}"
        centre = ", ".join(f"{v / UM:.1f}" for v in c.centre.centre)
        extremes = f"F {min(p.F_min for p in c.paths) / UM:.1f} to {max(p.F_max for p in c.paths) / UM:.1f}"
        lines.append(f"  {name:<10}  {each}{both}  {extremes}  D {c.D / UM:.1f} µm, centre [{centre}] µm taken off")
    lines += [f"  note        {warning}" for warning in test.warnings]
    lines.append(f"  written to  {folder}: circular.json, report.html")
    errors.print("\n".join(lines), markup=False)
