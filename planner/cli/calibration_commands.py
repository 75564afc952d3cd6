"""The commands of calibration: simulate, identify, import, compensate, and the evaluations of instruments."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import (
    IDENTIFY,
    CellOption,
    Json,
    MeasuredPlan,
    Output,
    OutputFile,
    PlanFile,
    Runs,
    Seed,
    errors,
    evaluation_step,
    give,
    give_file,
    print_notes,
)
from planner.common.errors import PARTLY_DONE
from planner.common.files import check_writing
from planner.common.lazy_modules import LazyModule

if TYPE_CHECKING:
    from planner.workflow import accuracy, circle_evaluation, identification
else:  # imported by the work itself, once its progress shows
    accuracy = LazyModule("planner.workflow.accuracy")
    circle_evaluation = LazyModule("planner.workflow.circle_evaluation")
    identification = LazyModule("planner.workflow.identification")


def simulate_command(
    plan_file: PlanFile,
    output: OutputFile,
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH", help="errors of the simulated robot: a TOML file, or its run as CSV")
    ] = None,
    change: Annotated[
        str, typer.Option(metavar="KEY=VALUE", help="added to an error of the truth, as in theta3_deg=0.2")
    ] = "",
    seed: Seed = 0,
) -> None:
    """Simulate the measured run of a plan, on a robot with known or drawn errors."""
    from planner.workflow.plan_reading import simulate

    made = simulate(plan_file, truth=truth, change=change, seed=seed)
    print_notes(made.run.warnings)
    give_file(made.text(), made.write, output, evaluation_step(output, plan_file))


def identify_command(
    runs: Runs,
    cell: CellOption,
    output: Output,
    plan: MeasuredPlan = None,
    validate: Annotated[Path | None, typer.Option(metavar="RUN", help="a run kept out of the fit, to judge it")] = None,
    no_trace: Annotated[bool, typer.Option("--no-trace", help="seek no causes of what geometry leaves")] = False,
    geometry: Annotated[bool, typer.Option("--geometry", help="the calibrated robot holds geometry alone")] = False,
    hold_out: Annotated[float, typer.Option(min=0.02, max=0.5, help="share of the groups held out at a time")] = 0.2,
    robust: Annotated[bool, typer.Option("--robust", help="turn down outliers (Huber)")] = False,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Identify the robot from measured runs: parameters with uncertainties, errors before and after."""
    give(
        lambda stages: identification.identify(
            runs,
            cell=cell,
            plan=plan,
            validate=validate,
            no_trace=no_trace,
            geometry=geometry,
            hold_out=hold_out,
            robust=robust,
            seed=seed,
            progress=stages.say,
        ),
        output,
        as_json,
        IDENTIFY,
    )


def import_command(
    traces: Annotated[list[Path], typer.Argument(metavar="TRACE...", help="controller and gauge traces")],
    map_file: Annotated[Path, typer.Option("--map", metavar="MAP.toml", help="which column is what")],
    output: OutputFile,
) -> None:
    """Bring controller and gauge traces into the run format."""
    from planner.runs.traces import import_run
    from planner.runs.writer import run_text, save_run

    run = import_run(traces, map_file)
    print_notes(run.warnings)
    step = f"edbb identify {output} --cell CELL -o calibrated"
    give_file(run_text(run), lambda path: save_run(run, path), output, step)


def compensate_command(
    targets: Annotated[Path, typer.Argument(metavar="PROGRAM|TARGETS", help="a robot program, or targets as CSV")],
    model: Annotated[Path, typer.Option(metavar="DIR/robot.toml", help="the calibrated robot")],
    output: OutputFile,
    dialect: Annotated[str | None, typer.Option(help="language of the file, or csv, where it does not tell")] = None,
    tool: Annotated[str | None, typer.Option(metavar="X,Y,Z,A,B,C", help="tool in the flange, mm and degrees")] = None,
    base: Annotated[str | None, typer.Option(metavar="X,Y,Z,A,B,C", help="base of poses, mm and degrees")] = None,
    frames: Annotated[Path | None, typer.Option(metavar="FILE", help="tools and bases: $config.dat, a module")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="write nothing unless every target of the file can be corrected")
    ] = False,
    cell: Annotated[
        str | None, typer.Option(metavar="CELL", help="the cell, to make sure that its controller does not correct too")
    ] = None,
) -> None:
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""
    from planner.workflow.compensation import compensate

    done = compensate(
        targets,
        model=model,
        dialect=dialect,
        tool=tool,
        base=base,
        frames=frames,
        strict=strict,
        cell=cell,
    )
    if output != "-":
        check_writing(Path(output), done.file.text.encode(done.file.encoding))
    errors.print(done.full_summary(), markup=False)
    step = f"load {output} into the controller and drive it slowly the first time"
    give_file(done.file.text, done.write, output, step)
    if done.file.partly:
        raise typer.Exit(PARTLY_DONE)


def accuracy_command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a tracker's run, or one of repeated centrings")],
    cell: CellOption,
    plan: MeasuredPlan = None,
    model: Annotated[Path | None, typer.Option(metavar="DIR/robot.toml", help="the calibrated robot")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="folder to write figures and report to")
    ] = None,
    as_json: Json = False,
) -> None:
    """Judge a robot before and after calibration by a tracker's run, or the precision of repeated centrings."""
    give(lambda stages: accuracy.check_accuracy(run, cell, stages, plan, model), output, as_json)


def circular_command(
    runs: Runs,
    plan: Annotated[
        Path, typer.Option(metavar="PLAN.json", help="the circular test that was measured, its cell.toml beside it")
    ],
    output: Output,
    as_json: Json = False,
) -> None:
    """Evaluate a circular test in the manner of ISO 230-4: deviations, reversals, the polar plot."""
    give(lambda stages: circle_evaluation.evaluate_circular_runs(runs, plan, stages), output, as_json)


def loaded_command(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="runs with force_N, .csv or .parquet")],
    cell: CellOption,
    output: Output,
    plan: MeasuredPlan = None,
    tracker: Annotated[Path | None, typer.Option(metavar="RUN", help="a tracker's run of the unloaded circle")] = None,
    unloaded: Annotated[
        list[Path] | None, typer.Option("--with", metavar="RUN", help="a bar's run without load, for one fit of both")
    ] = None,
    overshoot: Annotated[
        float | None, typer.Option(min=0.0, max=720.0, help="degrees dropped at either end (else as the cell says)")
    ] = None,
    as_json: Json = False,
) -> None:
    """Evaluate circles driven under load: joint compliances, and the circle as it would be without load."""
    from planner.common.units import DEG

    skipped = None if overshoot is None else overshoot * DEG
    give(
        lambda stages: circle_evaluation.evaluate_loaded(runs, cell, stages, plan, tracker, skipped, unloaded or ()),
        output,
        as_json,
    )
