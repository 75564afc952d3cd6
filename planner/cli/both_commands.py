"""The command ``edbb plan-both``: a session with a bar without load and a loaded one, for one fit of both."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import Json, Output, Screen, Seed, check_folder, errors, print_json
from planner.common.units import to_mm
from planner.instruments.loaded.results import share_text
from planner.session.options import PlanOptions
from planner.study.compliance_design.results import describe_common_fit
from planner.workflow.both_bars import (
    LOADED,
    UNLOADED,
    BothPlan,
    both_record,
    both_session_steps,
    plan_both,
    write_both,
)


def both_command(
    unloaded: Annotated[
        str, typer.Argument(metavar="UNLOADED", help="cell of the bar without load, or the plan.json of its plan")
    ],
    loaded: Annotated[str, typer.Argument(metavar="LOADED", help="cell of the loaded bar, with its circles")],
    output: Output,
    places: Annotated[int, typer.Option(min=1, max=12, help="circles of the loaded bar")] = 3,
    poses: Annotated[int | None, typer.Option(min=1, help="number of poses without load")] = None,
    seed: Seed = 0,
    dialect: Annotated[list[str] | None, typer.Option(help="robot language; may be repeated")] = None,
    as_json: Json = False,
) -> None:
    """Plan a session with both bars: poses without load, and the loaded circles that add most to one fit of both."""
    check_folder(output)
    options = PlanOptions(poses=poses, seed=seed, dialects=tuple(dialect or ()))
    with Screen() as stages:
        done = plan_both(unloaded, loaded, places, options, stages)
        write_both(done, output, stages)
    if as_json:
        print_json(both_record(done))
    else:
        _summary(done, output)


def _summary(done: BothPlan, folder: Path) -> None:
    known = done.known
    minutes = sum(d.duration for d in done.loaded.drives) / 60
    lines = [f"{done.loaded.cell.robot.name}: {len(done.free.q)} poses without load, {len(done.arcs)} loaded circles"]
    for arc in done.arcs:
        circle = arc.circle
        centre = ", ".join(f"{v:.0f}" for v in to_mm(circle.p_BC))
        lines.append(f"  {circle.name:<12}{circle.plane} about [{centre}] mm; {arc.told}")
    lines.append(f"  {'path':<12}{minutes:.1f} min with the loaded bar on, proven as every plan is")
    lines.append(f"  {'predicted':<12}{'':<14}{'without load':>14}{'circles':>12}{'one fit':>12}   of the prior size")
    for name, *parts in known.of("compliance"):
        first, second, both = (share_text(float(v)) for v in parts)
        lines.append(f"  {'':<12}{name:<14}{first:>14}{second:>12}{both:>12}")
    lines += [f"  found       {s}" for s in describe_common_fit(known)]
    lines += [f"  {k + 1}.{'':<10}{text}" for k, text in enumerate(both_session_steps(done))]
    lines += [f"  note        {note}" for note in done.loaded.notes]
    new = f"{UNLOADED}/, " if done.unloaded is not None else ""
    lines.append(f"  written to  {folder}: {new}{LOADED}/, cell.toml, both.json, pictures")
    errors.print("\n".join(lines), markup=False)
