"""The command study: what is typed there beside what its verb declares."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cell.declared import CELL
from planner.cli.declared import Values, declare_command, new_folder
from planner.cli.terminal import Json, Manner, Output, give
from planner.common.calls import find_function
from planner.common.errors import InputError
from planner.studies.study_call import StudyCall


def _study(
    values: Values,
    cell: str | None,
    output: Path,
    seed: int | None,
    sweep_file: Path | None,
    scheduler: str | None,
    cluster_keys: Path | None,
    as_json: bool,
    manner: Manner,
) -> None:
    if (cell is None) == (sweep_file is None):
        raise InputError("a study is of a cell, or of a sweep (--sweep SWEEP.toml): name one of the two")
    asked = {**values, **({} if seed is None else {"seed": seed})}
    if sweep_file is None:
        give(
            lambda stages: find_function(StudyCall)(cell, **asked, progress=stages.say),
            output,
            as_json,
            StudyCall.starts,
            manner,
        )
        return
    from planner.studies.sweep import sweep  # numbers and tables: other commands start quicker without

    give(
        lambda stages: sweep(
            sweep_file, output, **asked, scheduler=scheduler, cluster_keys=cluster_keys, progress=stages.say
        ),
        output,
        as_json,
        manner=manner,
    )


Seed = Annotated[int | None, typer.Option(min=0, help="the same seed gives the same bytes")]  # None: as a sweep says
Sweep = Annotated[
    Path | None,
    typer.Option("--sweep", metavar="SWEEP.toml", help="in place of a cell: cells x poses x any keys of theirs"),
]
Scheduler = Annotated[str | None, typer.Option(metavar="tls://…", help="compute the sweep on a Dask cluster")]
ClusterKeys = Annotated[
    Path | None, typer.Option(metavar="DIR", help="keys of that cluster; 'edbb serve keys DIR' makes them")
]
study_command = declare_command(
    StudyCall,
    _study,
    new_folder,
    cell=(Annotated[str | None, typer.Argument(metavar="[CELL]", help=CELL)], None),
    output=(Output, None),
    seed=(Seed, None),
    sweep_file=(Sweep, None),
    scheduler=(Scheduler, None),
    cluster_keys=(ClusterKeys, None),
    as_json=(Json, False),
)
