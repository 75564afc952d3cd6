"""The commands of calibration: simulate, identify, import, compensate."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.found import identification_summary
from planner.cli.options import Json, Output, Seed, check_folder, print_json
from planner.cli.screen import Screen, errors
from planner.errors import NoSolutionError
from planner.files import write_text
from planner.identification import Settings
from planner.identification.results import identification_content
from planner.run import import_run, run_text, save_run
from planner.workflow.compensating import Choices, compensate
from planner.workflow.identifying import identify_runs, write_identification
from planner.workflow.simulating import simulate_plan

OutputFile = Annotated[
    str, typer.Option("-o", "--output", metavar="FILE", help="file to write, or - for standard output")
]


def simulate_command(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.json", help="a plan with its cell.toml beside it")],
    output: OutputFile,
    truth: Annotated[Path | None, typer.Option(metavar="TRUTH.toml", help="errors of the simulated robot")] = None,
    seed: Seed = 0,
) -> None:
    """Simulate the measured run of a plan, on a robot with known or drawn errors."""
    run = simulate_plan(plan_file, truth, seed)
    for warning in run.warnings:
        errors.print(f"note: {warning}", markup=False)
    if output == "-":
        sys.stdout.write(run.comments() + run_text(run))
    elif output.lower().endswith(".csv"):
        write_text(Path(output), run.comments() + run_text(run))
    else:
        save_run(run, Path(output))


def identify_command(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="measured runs, .csv or .parquet")],
    cell: Annotated[str, typer.Option(metavar="CELL", help="a cell file, or robot/cell for a shipped one")],
    output: Output,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.json", help="the plan that was measured")] = None,
    validate: Annotated[Path | None, typer.Option(metavar="RUN", help="a run kept out of the fit, to judge it")] = None,
    no_trace: Annotated[bool, typer.Option("--no-trace", help="geometry and joint compliance only")] = False,
    hold_out: Annotated[float, typer.Option(min=0.02, max=0.5, help="share of the groups held out at a time")] = 0.2,
    robust: Annotated[bool, typer.Option("--robust", help="turn down outliers (Huber)")] = False,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Identify the robot from measured runs: parameters with uncertainties, errors before and after."""
    check_folder(output)
    with Screen() as stages:
        done = identify_runs(runs, cell, stages, plan, validate, Settings(hold_out, robust, seed), tracing=not no_trace)
        write_identification(done, output, stages)
    if as_json:
        print_json(identification_content(done.calibration, done.left))
    else:
        identification_summary(done.calibration, done.left, output)
    if done.calibration.problems:
        raise NoSolutionError(
            "the fit failed its own checks, no robot was written: " + "; ".join(done.calibration.problems)
        )


def import_command(
    traces: Annotated[list[Path], typer.Argument(metavar="TRACE...", help="controller and gauge traces")],
    map_file: Annotated[Path, typer.Option("--map", metavar="MAP.toml", help="which column is what")],
    output: OutputFile,
) -> None:
    """Bring controller and gauge traces into the run format."""
    run = import_run(traces, map_file)
    for warning in run.warnings:
        errors.print(f"note: {warning}", markup=False)
    if output == "-":
        sys.stdout.write(run_text(run))
    else:
        save_run(run, Path(output))


def compensate_command(
    targets: Annotated[Path, typer.Argument(metavar="PROGRAM|TARGETS", help="a robot program, or targets as CSV")],
    model: Annotated[Path, typer.Option(metavar="DIR/robot.toml", help="the calibrated robot")],
    output: OutputFile,
    dialect: Annotated[str | None, typer.Option(help="language of the file, or csv, where it does not tell")] = None,
    tool: Annotated[str | None, typer.Option(metavar="X,Y,Z,A,B,C", help="tool in the flange, mm and degrees")] = None,
    base: Annotated[str | None, typer.Option(metavar="X,Y,Z,A,B,C", help="base of poses, mm and degrees")] = None,
    frames: Annotated[Path | None, typer.Option(metavar="FILE", help="tools and bases: $config.dat, a module")] = None,
    keep_unsolved: Annotated[
        bool, typer.Option("--keep-unsolved", help="leave targets without a correction as they are")
    ] = False,
    cell: Annotated[
        str | None, typer.Option(metavar="CELL", help="the cell, to make sure that its controller does not correct too")
    ] = None,
) -> None:
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""
    done = compensate(targets, model, Choices(dialect, tool, base, frames, keep_unsolved, cell))
    errors.print(done.summary, markup=False)
    if output == "-":
        sys.stdout.write(done.text)
    else:
        write_text(Path(output), done.text, done.encoding)
