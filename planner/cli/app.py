"""The command ``edbb``; every failure ends in one sentence and its exit code."""

import sys
from typing import Annotated

import typer

from planner import __version__
from planner.cli import calibrating, centring, circular, loaded, planning
from planner.cli.screen import errors
from planner.errors import PlannerError

app = typer.Typer(
    name="edbb",
    help="Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("plan")(planning.plan_command)
app.command("study")(planning.study_command)
app.command("export")(planning.export_command)
app.command("simulate")(calibrating.simulate_command)
app.command("identify")(calibrating.identify_command)
app.command("import")(calibrating.import_command)
app.command("compensate")(calibrating.compensate_command)
app.command("circular")(circular.circular_command)
app.command("loaded")(loaded.loaded_command)
app.command("loaded-places")(loaded.places_command)
app.command("centre")(centring.centre_command)
app.command("robots")(planning.robots_command)
app.command("dialects")(planning.dialects_command)


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
