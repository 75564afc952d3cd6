"""The commands of planning: plan, study, export, and the circular test."""

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from planner.cell.cell import Cell
from planner.cell.file import Aim
from planner.cell.reading import load_cell
from planner.cli.terminal import (
    CellArgument,
    Index,
    Json,
    Output,
    Screen,
    Seed,
    check_folder,
    errors,
    print_json,
    written_line,
)
from planner.common.errors import InputError
from planner.common.units import UM, to_deg, to_mm
from planner.design.bayesian_design import describe_bayesian_design
from planner.design.observability.information import INDEX_RULES
from planner.instruments.circular.evaluation import CircularTest, circular_test_content
from planner.instruments.circular.plan import CircularPlan, circular_content
from planner.instruments.circular.planning import plan_circles
from planner.session.options import PlanOptions, check_circle_options
from planner.session.plan_record import plan_document
from planner.session.plan_types import Plan
from planner.workflow.circle_evaluation import evaluate_circular_runs, write_circular_test
from planner.workflow.plan_reading import export_plan
from planner.workflow.planning import plan
from planner.workflow.writing import write_circular_plan, write_plan, write_program_as


def plan_summary(plan: Plan, folder: Path) -> None:
    """Say in a few lines what was planned, how good it provably is, and where it lies."""
    choice, drives = plan.choice, plan.drives
    gap = INDEX_RULES[choice.index].gap
    bound = choice.certificate.value
    tour_s, unsorted_s = sum(d.tour.cost_s for d in drives), sum(d.tour.unsorted_s for d in drives)
    clearance = min(d.path.clearance for d in drives) * 1e3
    proof = (
        f"of the candidates no such set is better than {bound:#.4g} (theirs {choice.on_grid_value:#.4g}, gap "
        f"{100 * gap(choice.on_grid_value, bound):.1f} %)"
        if plan.by_index
        else f"it did not choose the poses (of the candidates no such set is better than {bound:#.4g})"
    )
    lines = [
        f"{plan.cell.name}: {len(choice.q)} poses for {choice.seen.rank} parameters, plan {plan.plan_id}",
        f"  candidates  {plan.pool.funnel.text()}",
        f"  {choice.index:<10}  {choice.value:#.4g}; {proof}",
        f"  tour        {unsorted_s:.1f} s unsorted, {tour_s:.1f} s sorted"
        f" ({'proven shortest' if all(d.tour.optimal for d in drives) else 'not proven shortest'}),"
        f" {sum(d.trajectory.duration_s for d in drives) / 60:.1f} min as driven",
        f"  path        {clearance:.1f} mm clearance, proven continuously by coal and judged again by fcl",
    ]
    lines += [f"  foresees    {describe_bayesian_design(plan.foresight)}"] if plan.foresight else []
    lines += [f"  tells apart {text}" for text in plan.separation.texts()] if plan.separation else []
    lines += [f"  left out    {d.name}: {d.because}" for d in choice.seen.dropped]
    lines += [f"  note        {note}" for note in plan.notes]
    lines.append(written_line(folder, [f.name for _, files in plan.programs for f in files]))
    errors.print("\n".join(lines), markup=False)


def plan_circular_test(cell: Cell, output: Path, options: PlanOptions, as_json: bool) -> None:
    """Plan the ``[[circles]]`` of a cell and write all that belongs to it."""
    check_circle_options(cell, options)
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
        _circular_test_summary(found, output)


def _circular_test_summary(test: CircularTest, folder: Path) -> None:
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


def plan_command(
    cell: CellArgument,
    output: Output,
    poses: Annotated[
        int | None, typer.Option(min=1, help="number of poses (default: where the index curve bends)")
    ] = None,
    index: Annotated[Index | None, typer.Option(help="observability index to select by")] = None,
    seed: Seed = 0,
    dialect: Annotated[list[str] | None, typer.Option(help="robot language; may be repeated")] = None,
    tsp: Annotated[Literal["auto", "exact", "concorde"], typer.Option(help="tour solver")] = "auto",
    separate: Annotated[
        Path | None,
        typer.Option(metavar="IDENTIFICATION.json", help="choose poses that tell its findings from their rivals"),
    ] = None,
    fixtures: Annotated[
        int | None, typer.Option(min=1, max=6, help="fixtures in all: good places are found for those beside the first")
    ] = None,
    aim: Annotated[
        Aim | None, typer.Option(help="poses by the index, or by the error that is left once hidden effects are traced")
    ] = None,
    as_json: Json = False,
) -> None:
    """Plan a measuring session: poses, certificate, collision-free path, robot program, report."""
    options = PlanOptions(poses, index, seed, tuple(dialect or ()), tsp, separate, fixtures, aim)
    check_folder(output)
    chosen = load_cell(cell)
    if chosen.circles:
        plan_circular_test(chosen, output, options, as_json)
        return
    with Screen() as stages:
        result = plan(chosen, options, stages)
        write_plan(result, output, stages)
    if as_json:
        print_json(plan_document(result).content())
    else:
        plan_summary(result, output)


def study_command(
    cell: CellArgument,
    output: Output,
    index: Annotated[Index | None, typer.Option(help="observability index")] = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Observability offline: what can be seen, with how many poses, from which fixture."""
    from planner.study.cell_study import study_cell as study  # matplotlib: other commands start quicker without

    check_folder(output)
    with Screen() as stages:
        summary = study(load_cell(cell), output, index, seed, stages.say)
    if as_json:
        print_json(summary.content())
    else:
        errors.print(summary.text(), markup=False)


def export_command(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.json", help="a plan with its cell.toml beside it")],
    dialect: Annotated[str, typer.Option(help="robot language")],
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="FILE", help="file to write, or - for standard output")
    ],
) -> None:
    """Write the robot program of a plan in any dialect; the cell.toml beside the plan must be the plan's own."""
    files = export_plan(plan_file, dialect, "-" if output == "-" else Path(output).name)
    if output == "-":
        if len(files) > 1:
            names = ", ".join(f.name for f in files)
            raise InputError(f"dialect '{dialect}' writes {len(files)} files ({names}); give a file name with -o")
        sys.stdout.write(files[0].text)
        return
    for line in write_program_as(files, Path(output)):
        errors.print(line, markup=False, highlight=False, soft_wrap=True)
