"""The commands ``edbb loaded`` and ``edbb loaded-places``: circles driven under the loads of a bar."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.options import CellArgument, Json, Output, Seed, check_folder, print_json
from planner.cli.screen import Screen, errors
from planner.errors import NoSolutionError
from planner.loaded import Loaded, Options
from planner.loaded.joint import Joint
from planner.loaded.results import loaded_content
from planner.loaded.sentences import known_as, share
from planner.units import DEG, UM
from planner.workflow.loaded import evaluate_loaded, write_loaded


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
    options = Options(None if overshoot is None else overshoot * DEG)
    with Screen() as stages:
        done = evaluate_loaded(runs, cell, stages, plan, tracker, options, unloaded or ())
        write_loaded(done, output, stages)
    found = done.found
    if as_json:
        print_json(loaded_content(found, done.joint))
    else:
        _summary(found, done.joint, output)
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
    from planner.study.softness.results import places_content, sentences  # plotting: others start quicker without
    from planner.workflow.loaded_places import beside_plan, study_places, write_places

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
            f"  {name}: without load {share(unloaded)}, the {places} circles {share(loaded)}, in one fit "
            f"{share(together)} of its prior size"
        )
    lines.append(f"  written to  {output}: places.json, places.csv, cell.toml, pictures")
    errors.print("\n".join(lines), markup=False)


def _summary(found: Loaded, joint: Joint | None, folder: Path) -> None:
    c = found.compliances
    lines = [f"{found.name}: {len(found.circles)} circle{'s' * (len(found.circles) > 1)} of {found.robot}"]
    lines += [f"  {name:<12}{known_as(c, k)}" for k, name in enumerate(c.names)]
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
