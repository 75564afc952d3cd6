"""The commands that watch a calibrated robot over the years: plan-check, check, record."""

from datetime import date as Day
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import CellArgument, Dialects, Json, MeasuredPlan, Output, Seed, give
from planner.common.lazy_modules import LazyModule

if TYPE_CHECKING:
    from planner.workflow import checking, recording
else:  # imported by the work itself, once its progress shows
    checking = LazyModule("planner.workflow.checking")
    recording = LazyModule("planner.workflow.recording")

BaselineFolder = Annotated[Path, typer.Option(metavar="DIR", help="folder of the identification that edbb wrote")]


def plan_check_command(
    cell: CellArgument,
    baseline: BaselineFolder,
    output: Output,
    poses: Annotated[int, typer.Option(min=4, max=60, help="number of poses")] = 10,
    seed: Seed = 0,
    dialect: Dialects = None,
    as_json: Json = False,
) -> None:
    """Plan about ten poses that tell whether and where a robot has changed since its calibration."""
    give(
        lambda stages: checking.plan_check(
            cell, baseline, poses=poses, seed=seed, dialect=tuple(dialect or ()), progress=stages.say
        ),
        output,
        as_json,
    )


def check_command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="the run of a check, .csv or .parquet")],
    baseline: BaselineFolder,
    output: Output,
    plan: MeasuredPlan = None,
    cell: Annotated[str | None, typer.Option(metavar="CELL", help="where no plan was driven: the cell")] = None,
    limit_mm: Annotated[
        float | None, typer.Option(min=0.0, help="motion of the tool that is allowed (default: any change fails)")
    ] = None,
    as_json: Json = False,
) -> None:
    """Judge the run of a check: has the robot changed, where most likely, and what is to be done."""
    give(
        lambda stages: checking.check(run, baseline, plan=plan, cell=cell, limit_mm=limit_mm, progress=stages.say),
        output,
        as_json,
    )


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
    tool: Annotated[str, typer.Option(help="on the flange")] = "",
    gauge: Annotated[str, typer.Option(help="kind and serial number of the gauge")] = "",
    certificate: Annotated[str, typer.Option(help="number of the gauge's certificate")] = "",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="folder to write history and report to")
    ] = None,
    as_json: Json = False,
) -> None:
    """Keep the history of one robot: calibrations, validations, checks, and what changed between them."""
    from planner.common.schema import validate
    from planner.instruments.record import Circumstances

    said = {
        "date": date or Day.today().isoformat(), "operator": operator, "temperature_degC": temperature, "tool": tool,
        "gauge": gauge, "certificate": certificate,
    }  # fmt: skip
    when = validate(said, Circumstances, "edbb record")
    give(lambda _: recording.record(folder, add=add, serial=serial, circumstances=when), output, as_json)
