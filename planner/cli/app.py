"""The command ``edbb``; every failure ends in one sentence and its exit code."""

import sys
from typing import Annotated

import typer

from planner import __version__
from planner.cli.screen import errors
from planner.cli.verbs import Verbs
from planner.errors import PlannerError

app = typer.Typer(
    name="edbb",
    cls=Verbs,
    help="Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def root(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    """Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot."""
    if version:
        typer.echo(f"edbb {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line; the exit code is the error's own (0 done, 1 bug, 2 input, 3 no solution, 4 missing)."""
    try:
        app(standalone_mode=True)
    except PlannerError as err:
        errors.print(f"edbb: {err}", markup=False)
        sys.exit(err.exit_code)
