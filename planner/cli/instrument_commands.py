"""The commands accuracy, loaded and loaded-places."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import CellArgument, Json, Output, Screen, Seed, check_folder, errors, print_json
from planner.common.errors import NoSolutionError
from planner.common.units import DEG, UM
from planner.instruments.accuracy.validation import Validation
from planner.instruments.loaded.evaluation import LoadedOptions
from planner.instruments.loaded.joint_fit import JointFit
from planner.instruments.loaded.results import compliance_text, loaded_content, share_text
from planner.instruments.loaded.types import LoadedEvaluation
from planner.workflow.accuracy import AccuracyCheck, Centrings, check_accuracy, write_accuracy
from planner.workflow.circle_evaluation import evaluate_loaded, write_loaded

FILES = "accuracy.json, accuracy.png, report.html"


def accuracy_command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a tracker's run, or one of repeated centrings")],
    cell: Annotated[str, typer.Option(metavar="CELL", help="a cell file, or robot/cell for a shipped one")],
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.json", help="the plan that was measured")] = None,
    model: Annotated[Path | None, typer.Option(metavar="DIR/robot.toml", help="the calibrated robot")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="folder to write figures and report to")
    ] = None,
    as_json: Json = False,
) -> None:
    """Judge a robot before and after calibration by a tracker's run, or the precision of repeated centrings."""
    if output is not None:
        check_folder(output)
    with Screen() as stages:
        done = check_accuracy(run, cell, stages, plan, model)
        if output is not None:
            write_accuracy(done, output, stages)
    if as_json:
        print_json(done.content)
    else:
        _summary(done, output)


def _summary(done: AccuracyCheck, folder: Path | None) -> None:
    found = done.found
    lines = _validation(found) if isinstance(found, Validation) else _precision(found)
    lines += [f"  note        {note}" for note in found.notes]
    if folder is not None:
        more = ", errors.csv" if isinstance(found, Validation) else ""
        lines.append(f"  written to  {folder}: {FILES}{more}")
    errors.print("\n".join(lines), markup=False)


def _validation(found: Validation) -> list[str]:
    misses = ", ".join(f"{n} {m / UM:.0f} µm" for n, m in zip(found.nests, found.frame.misses, strict=True))
    lines = [f"{found.run.name}: {len(found.run)} poses", f"  frame       from the nests, which miss by {misses}"]
    for name, judged in (("before", found.before), ("after", found.after)):
        lines += [] if judged is None else [f"  {name:<12}{judged.figures.text()}"]
    return [*lines, f"  floor       {found.floor.text()}"]


def _precision(found: Centrings) -> list[str]:
    s = found.repeats.summary
    std = ", ".join(f"{v / UM:.1f}" for v in s.axis_std)
    lines = [
        f"{found.run.name}: {s.centrings} centrings of {s.poses} poses",
        f"  precision   at most {s.largest / UM:.1f} µm from the mean of a pose, rms {s.rms / UM:.1f} µm, "
        f"two of a pose at most {s.apart / UM:.1f} µm apart; std {std} µm along x, y, z",
        f"  expected    rms {found.repeats.expected / UM:.1f} µm of the robot's repeatability and the gauge's noise",
    ]
    return lines if found.master is None else [*lines, f"  mastering   {found.master.text()}"]


def loaded_command(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="runs with force_N, .csv or .parquet")],
    cell: Annotated[str, typer.Option(metavar="CELL", help="a cell file, or robot/cell for a shipped one")],
    output: Output,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.json", help="the plan that was measured")] = None,
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
    check_folder(output)
    options = LoadedOptions(None if overshoot is None else overshoot * DEG)
    with Screen() as stages:
        done = evaluate_loaded(runs, cell, stages, plan, tracker, options, unloaded or ())
        write_loaded(done, output, stages)
    found = done.found
    if as_json:
        print_json(loaded_content(found, done.joint))
    else:
        _loaded_summary(found, done.joint, output)
    problems = (*found.problems, *(done.joint.problems if done.joint else ()))
    if problems:
        raise NoSolutionError("the compliances failed their own check: " + "; ".join(problems))


def places_command(
    cell: CellArgument,
    output: Output,
    places: Annotated[int, typer.Option(min=1, max=12, help="circles of the cell.toml that is written")] = 4,
    plan: Annotated[
        Path | None, typer.Option("--with", metavar="PLAN.json", help="a plan without load, to be fitted together")
    ] = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Find the places where loaded circles tell the joints' compliances apart."""
    # plotting: others start quicker without
    from planner.study.compliance_design.results import describe_places as sentences
    from planner.study.compliance_design.results import places_content
    from planner.workflow.loaded_places import predict_beside_plan as beside_plan
    from planner.workflow.loaded_places import study_places, write_places

    check_folder(output)
    with Screen() as stages:
        where, found = study_places(cell, places, seed, stages)
        both = None if plan is None else beside_plan(where, found, places, plan)
        write_places(where, found, places, output, stages, both)
    if as_json:
        print_json(places_content(found, where.robot.name, both))
        return
    lines = [f"{where.name}: {len(found.pool)} places can be driven", *(f"  {s}" for s in sentences(found))]
    for name, unloaded, loaded, together in () if both is None else both.of("compliance"):
        lines.append(
            f"  {name}: without load {share_text(unloaded)}, the {places} circles {share_text(loaded)}, in one fit "
            f"{share_text(together)} of its prior size"
        )
    lines.append(f"  written to  {output}: places.json, places.csv, cell.toml, pictures")
    errors.print("\n".join(lines), markup=False)


def _loaded_summary(found: LoadedEvaluation, joint: JointFit | None, folder: Path) -> None:
    c = found.compliances
    lines = [f"{found.name}: {len(found.circles)} circle{'s' * (len(found.circles) > 1)} of {found.robot}"]
    lines += [f"  {name:<12}{compliance_text(c, k)}" for k, name in enumerate(c.names)]
    if joint is not None:
        lines.append(
            f"  in one fit with runs without load: {len(joint.names)} parameters, {joint.rms[0] / UM:.1f} µm left "
            f"without load, {joint.rms[1] / UM:.1f} µm under load"
        )
        lines += [
            f"  {e.name:<12}{e.value * 1e6:.3f} ± {e.std * 1e6:.3f} µrad/Nm"
            for e in joint.estimates
            if e.name in c.names and e.std is not None
        ]
    both = "" if joint is None else "joint.csv, "
    lines += [f"  found       {s}" for s in found.sentences]
    lines += [f"  note        {w}" for w in found.warnings]
    lines.append(f"  written to  {folder}: loaded.json, curves.csv, averaged.csv, {both}report.html, pictures")
    errors.print("\n".join(lines), markup=False)
