"""The commands of calibration: simulate, identify, import, compensate."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import Json, Output, Screen, Seed, check_folder, errors, print_json
from planner.common.errors import NoSolutionError
from planner.common.files import write_text
from planner.common.units import MM
from planner.identification.calibration import Calibration
from planner.identification.pipeline import FitSettings
from planner.model.identification_document import Metrics
from planner.runs.traces import import_run
from planner.runs.writer import run_text, save_run
from planner.workflow.compensation import CompensationOptions, compensate
from planner.workflow.identification import identify_runs, write_identification
from planner.workflow.plan_reading import simulate_plan

NAMED = 3  # rivals that are listed by name


def identification_summary(found: Calibration, folder: Path) -> None:
    """Say in a few lines how far off the robot is before and after, and why."""
    wide = 2 + max(26, *(len(s.name) for s in found.stages))
    fitted = sum(e.identifiable for e in found.estimates)
    lines = [
        f"{found.run.name}: {len(found.run)} samples, {found.n_groups} {_plural(found.split.by)}, "
        f"{100 * found.split.hold_out:.0f} % held out at a time, {fitted} parameters",
        f"  {'':<{wide}}{'held out: rms':>14}{'mean':>10}{'largest':>10}"
        + (f"{'validation: mean':>20}" if _has_validation(found) else ""),
    ]
    for stage in found.stages:
        lines.append(f"  {stage.name:<{wide}}{_metrics_row(stage.held_out)} mm" + _mean_text(stage.validation))
    if found.tried is not None:
        lines += [f"  found       {f.note}" + _rival_text(f.rivals) for f in found.findings]
        lines += [] if found.findings else ["  found       nothing beyond noise that the catalogue can name"]
    lines.append(f"  left        {found.diagnosis.sentence}")
    lines += [f"  note        {w}" for w in found.warnings]
    lines.append(
        f"  written to  {folder}: identification.json, residuals.csv, report.html" + _robot_files(found, folder)
    )
    errors.print("\n".join(lines), markup=False)


def _plural(group: str) -> str:
    return f"{group}es" if group.endswith("ch") else f"{group}s"


def _has_validation(found: Calibration) -> bool:
    return found.stages[-1].validation is not None


def _metrics_row(m: Metrics) -> str:
    return f"{m.rms / MM:14.4f}{m.mean / MM:10.4f}{m.largest / MM:10.4f}"


def _mean_text(m: Metrics | None) -> str:
    return "" if m is None else f"{m.mean / MM:13.4f} mm"


def _rival_text(names: tuple[str, ...]) -> str:
    if not names:
        return ""
    more = f" or {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"; or {', or '.join(names[:NAMED])}{more}: the run cannot tell them apart"


def _robot_files(found: Calibration, folder: Path) -> str:
    if found.problems:
        return ""
    return ", robot.toml" + (", robot.urdf" if (folder / "robot.urdf").exists() else "")


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
        done = identify_runs(
            runs, cell, stages, plan, validate, FitSettings(hold_out, robust, seed), tracing=not no_trace
        )
        write_identification(done, output, stages)
    if as_json:
        print_json(done.content())
    else:
        identification_summary(done, output)
    if done.problems:
        raise NoSolutionError("the fit failed its own checks, no robot was written: " + "; ".join(done.problems))


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
    done = compensate(targets, model, CompensationOptions(dialect, tool, base, frames, keep_unsolved, cell))
    errors.print(done.summary, markup=False)
    if output == "-":
        sys.stdout.write(done.text)
    else:
        write_text(Path(output), done.text, done.encoding)
