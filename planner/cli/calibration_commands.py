"""The commands of calibration: simulate, identify, import, compensate, evaluations of instruments, checks, records."""

import re
from datetime import date as Day
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import (
    IDENTIFY,
    CellArgument,
    CellOption,
    Dialects,
    Json,
    MeasuredPlan,
    Output,
    OutputFile,
    PlanFile,
    Runs,
    Screen,
    Seed,
    errors,
    evaluation_step,
    give,
    give_file,
    print_notes,
)
from planner.common.errors import PARTLY_DONE, InputError
from planner.common.files import check_writing
from planner.common.lazy_modules import LazyModule

if TYPE_CHECKING:
    from planner.workflow import accuracy, checking, circle_evaluation, identification, recording
else:  # imported by the work itself, once its progress shows
    accuracy = LazyModule("planner.workflow.accuracy")
    checking = LazyModule("planner.workflow.checking")
    circle_evaluation = LazyModule("planner.workflow.circle_evaluation")
    identification = LazyModule("planner.workflow.identification")
    recording = LazyModule("planner.workflow.recording")


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
    with Screen():
        from planner.workflow.plan_use import simulate

        made = simulate(plan_file, truth=truth, change=change, seed=seed)
        text = made.text()
    print_notes(made.run.warnings)
    give_file(text, made.write, output, evaluation_step(output, plan_file))


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
    output: OutputFile,
    map_file: Annotated[Path | None, typer.Option("--map", metavar="MAP.toml", help="which column is what")] = None,
    plan: MeasuredPlan = None,
    dialect: Annotated[str | None, typer.Option(help="of the plan's program, whose own log is the first trace")] = None,
) -> None:
    """Bring controller and gauge traces into the run format: by a map, or the log of a plan's own program."""
    if (map_file is None) == (plan is None or dialect is None) or (map_file is not None and (plan or dialect)):
        raise InputError(
            "give either --map MAP.toml, or --plan PLAN.json and --dialect of the program that kept the log"
        )
    with Screen():
        from planner.runs.traces import import_run
        from planner.runs.writer import run_text, save_run
        from planner.workflow.plan_use import import_log

        run = import_run(traces, map_file) if map_file else import_log(traces, plan or "", dialect or "")
    print_notes(run.warnings)
    step = f"edbb identify {output} --cell CELL {f'--plan {plan} ' if plan else ''}-o calibrated"
    give_file(run_text(run), lambda path: save_run(run, path), output, step)


def compensate_command(
    targets: Annotated[Path, typer.Argument(metavar="PROGRAM|TARGETS", help="a robot program, or targets as CSV")],
    model: Annotated[Path, typer.Option(metavar="DIR/robot.toml", help="the calibrated robot, or its folder")],
    output: OutputFile,
    dialect: Annotated[str | None, typer.Option(help="language of the file, or csv, where it does not tell")] = None,
    tool: Annotated[
        str | None, typer.Option(metavar="X,Y,Z,A,B,C|model", help="tool in the flange, mm and degrees, or the model's")
    ] = None,
    base: Annotated[str | None, typer.Option(metavar="X,Y,Z,A,B,C", help="base of poses, mm and degrees")] = None,
    frames: Annotated[Path | None, typer.Option(metavar="FILE", help="tools and bases: $config.dat, a module")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="write nothing unless every target of the file can be corrected")
    ] = False,
    cell: Annotated[
        str | None, typer.Option(metavar="CELL", help="the cell, to make sure that its controller does not correct too")
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="add to the correction by another model, whose mark the file bears")
    ] = False,
    measuring: Annotated[
        bool, typer.Option("--measuring", help="correct a measuring program too, whose way is proven uncorrected only")
    ] = False,
    date: Annotated[
        str | None, typer.Option(metavar="YYYY-MM-DD", help="in the mark of the file (default: of the model's file)")
    ] = None,
    axes_of: Annotated[
        str | None, typer.Option(metavar="LANGUAGE", help="of the controller whose axes a table's joint angles are")
    ] = None,
    zeros_set: Annotated[
        str, typer.Option(metavar="2,3,…", help="axes whose zeros were set in the controller by this identification")
    ] = "",
) -> None:
    """Correct the targets of a program so that the calibrated robot stands where the nominal one should."""
    with Screen():
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
            again=again,
            measuring=measuring,
            date=date,
            axes_of=axes_of,
            zeros_set=_axes(zeros_set),
        )
    if output != "-":
        check_writing(Path(output), done.file.text.encode(done.file.encoding))
    errors.print(done.full_summary())
    give_file(done.file.text, done.write, output, done.file.step.format(file=output))
    if done.file.partly:
        raise typer.Exit(PARTLY_DONE)


def _axes(text: str) -> tuple[int, ...]:
    """Return the numbers of axes that an option lists."""
    if text and not re.fullmatch(r"\s*[0-9]{1,3}\s*(,\s*[0-9]{1,3}\s*)*", text):
        raise InputError(f"--zeros-set '{text}': numbers of axes are allowed, such as 2,3,4")
    return tuple(sorted({int(word) for word in text.split(",") if text}))


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
