"""The command ``edbb accuracy``: how far a robot is from where it should be, or how closely centrings agree."""

from pathlib import Path
from typing import Annotated

import typer

from planner.accuracy import Validation
from planner.cli.options import Json, check_folder, print_json
from planner.cli.screen import Screen, errors
from planner.units import UM
from planner.workflow.accuracy import Accuracy, Centrings, check_accuracy, write_accuracy

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


def _summary(done: Accuracy, folder: Path | None) -> None:
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
