"""The command fleet."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.declared import new_file
from planner.cli.terminal import (
    PLAINLY,
    Json,
    Manner,
    OutputFile,
    Screen,
    check_file,
    errors,
    give_file,
    print_json,
    screen_of,
)
from planner.common.lazy_modules import LazyModule
from planner.common.summary import SCREEN_LINES

if TYPE_CHECKING:
    from planner.workflow import fleet as fleets
else:  # imported by the work itself
    fleets = LazyModule("planner.workflow.fleet")


def fleet_command(
    records: Annotated[
        list[Path], typer.Argument(metavar="RECORD...", help="records of robots, or folders of identifications")
    ],
    output: OutputFile = None,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """Learn from several robots of a kind how large their errors are, joint by joint: a prior for the next one."""
    output = new_file(".toml")("fleet", records) if output is None else output
    check_file(output, manner.force)
    with Screen():
        found = fleets.fleet(records)
    (errors if as_json else screen_of(output)).print(found.full_summary(manner.verbose, SCREEN_LINES - 1))
    if as_json:
        _ = found.write(output, manner.force)
        print_json(dict(found.content()))
        return
    give_file(found.text(), lambda path: found.write(path, manner.force), output, found.next_step(Path(output)))
