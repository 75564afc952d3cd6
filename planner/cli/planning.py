"""The commands of planning: plan, study, export."""

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from planner.cell import Aim, load_cell
from planner.cli.circular import plan_circular_test
from planner.cli.options import CellArgument, Index, Json, Output, Seed, check_folder, print_json
from planner.cli.screen import Screen, errors
from planner.cli.summary import plan_summary
from planner.errors import InputError
from planner.plan import plan_content
from planner.workflow import Options, export_plan, plan, write_plan, write_program_as


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
    options = Options(poses, index, seed, tuple(dialect or ()), tsp, separate, fixtures, aim)
    check_folder(output)
    chosen = load_cell(cell)
    if chosen.circles:
        plan_circular_test(chosen, output, options, as_json)
        return
    with Screen() as stages:
        result = plan(chosen, options, stages)
        write_plan(result, output, stages)
    if as_json:
        print_json(plan_content(result))
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
    from planner.study import study  # matplotlib: other commands start quicker without

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
