"""The commands of planning: study, export, plan-both, loaded-places."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import (
    CELL,
    PLAN,
    STUDY,
    CellArgument,
    Dialects,
    Json,
    Output,
    OutputFile,
    PlanFile,
    Screen,
    Seed,
    errors,
    evaluation_step,
    give,
    print_next,
)
from planner.common.choices import IndexName
from planner.common.errors import InputError
from planner.common.lazy_modules import LazyModule
from planner.common.progress import Stages
from planner.common.result import Result

if TYPE_CHECKING:
    from planner.studies import cell_study, sweep
    from planner.workflow import loaded_planning
else:  # imported by the work itself, once its progress shows
    cell_study = LazyModule("planner.studies.cell_study")
    sweep = LazyModule("planner.studies.sweep")
    loaded_planning = LazyModule("planner.workflow.loaded_planning")


def study_command(
    output: Output,
    cell: Annotated[str | None, typer.Argument(metavar="[CELL]", help=CELL)] = None,
    sweep_file: Annotated[
        Path | None,
        typer.Option("--sweep", metavar="SWEEP.toml", help="in place of a cell: fixtures x bars x tools x poses"),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://…", help="compute the sweep on a Dask cluster")
    ] = None,
    index: Annotated[IndexName | None, typer.Option(help="observability index")] = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Observability offline: what can be seen, with how many poses, from which fixture."""
    if (cell is None) == (sweep_file is None):
        raise InputError("a study is of a cell, or of a sweep (--sweep SWEEP.toml): name one of the two")
    if cell is not None:
        give(lambda stages: cell_study.study(cell, index=index, seed=seed, progress=stages.say), output, as_json, STUDY)
    elif sweep_file is not None:
        give(lambda s: sweep.sweep(sweep_file, output, scheduler=scheduler, progress=s.say), output, as_json)


def export_command(
    plan_file: PlanFile, dialect: Annotated[str, typer.Option(help="robot language")], output: OutputFile
) -> None:
    """Write the robot program of a plan in any dialect; the cell.toml beside the plan must be the plan's own."""
    with Screen():
        from planner.workflow.plan_use import export

        made = export(plan_file, dialect=dialect, name="-" if output == "-" else Path(output).name)
    if output == "-":
        if len(made.programs) > 1:
            names = ", ".join(f.name for f in made.programs)
            raise InputError(
                f"dialect '{dialect}' writes {len(made.programs)} files ({names}); give a file name with -o"
            )
        sys.stdout.write(made.programs[0].text)
        return
    for line in (*made.notes, *made.write(output)):
        errors.print(line)
    print_next(f"run {output}, measure; {evaluation_step('run.csv', plan_file)}")


def plan_both_command(
    unloaded: Annotated[
        str, typer.Argument(metavar="UNLOADED", help="cell of the bar without load, or the plan.json of its plan")
    ],
    loaded: Annotated[str, typer.Argument(metavar="LOADED", help="cell of the loaded bar, with its circles")],
    output: Output,
    places: Annotated[int, typer.Option(min=1, max=12, help="circles of the loaded bar")] = 3,
    poses: Annotated[int | None, typer.Option(min=1, help="number of poses without load")] = None,
    seed: Seed = 0,
    dialect: Dialects = None,
    as_json: Json = False,
) -> None:
    """Plan a session with both bars: poses without load, and the loaded circles that add most to one fit of both."""

    def work(stages: Stages) -> Result:
        from planner.session.options import PlanOptions  # once its progress shows

        options = PlanOptions(poses=poses, seed=seed, dialect=tuple(dialect or ()))
        return loaded_planning.plan_both(unloaded, loaded, places, options, stages)

    give(work, output, as_json, PLAN)


def loaded_places_command(
    cell: CellArgument,
    output: Output,
    places: Annotated[int, typer.Option(min=1, max=12, help="circles of the cell.toml that is written")] = 4,
    plan: Annotated[
        Path | None, typer.Option("--with", metavar="PLAN.json", help="a plan without load, to be fitted together")
    ] = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Find the places where loaded circles tell the joints' compliances apart."""
    give(lambda stages: loaded_planning.study_places(cell, places, seed, stages, plan), output, as_json)
