"""The command record."""

from datetime import date as Day
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import PLAINLY, Json, Manner, OptionalOutput, give
from planner.common.lazy_modules import LazyModule

if TYPE_CHECKING:
    from planner.workflow import recording
else:  # imported by the work itself, once its progress shows
    recording = LazyModule("planner.workflow.recording")


def record_command(
    folder: Annotated[Path, typer.Argument(metavar="RECORD", help="folder of the robot's record")],
    add: Annotated[
        Path | None, typer.Option(metavar="DIR", help="what identify, accuracy or check wrote, to be added")
    ] = None,
    serial: Annotated[str | None, typer.Option(help="serial number of the robot, for a new record")] = None,
    date: Annotated[
        str | None, typer.Option(metavar="YYYY-MM-DD", help="day of what is added (default: today)")
    ] = None,
    operator: Annotated[str, typer.Option(help="who measured")] = "",
    temperature: Annotated[float | None, typer.Option("--temperature-degC", help="of the room")] = None,
    tool: Annotated[str, typer.Option("--tool-name", help="on the flange")] = "",
    gauge: Annotated[str, typer.Option(help="kind and serial number of the gauge")] = "",
    certificate: Annotated[str, typer.Option(help="number of the gauge's certificate")] = "",
    withdraw: Annotated[
        int | None, typer.Option(metavar="ENTRY", help="number of an entry that counts no more; it stays")
    ] = None,
    reason: Annotated[str, typer.Option(help="why it is withdrawn")] = "",
    output: OptionalOutput = None,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """Keep the history of one robot: calibrations, validations, checks, and what changed between them."""
    from planner.checks.record import Circumstances
    from planner.common.schema import validate

    said = {
        "date": date or Day.today().isoformat(), "operator": operator, "temperature_degC": temperature, "tool": tool,
        "gauge": gauge, "certificate": certificate,
    }  # fmt: skip
    when = validate(said, Circumstances, "edbb record")

    def keep(_: object) -> "recording.RecordResult":
        """Show the record, after what is to be added or withdrawn."""
        return recording.record(folder, add=add, serial=serial, circumstances=when, withdraw=withdraw, reason=reason)

    give(keep, output, as_json, manner=manner)
