"""What comes with the planner: lists of robots and of robot languages."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planner.cli.terminal import PLAINLY, Json, Manner, SafeConsole, errors, print_json, print_next
from planner.common.console import as_word
from planner.common.errors import InputError, make_printable
from planner.common.summary import fact_lines

WIDE_SIGNS = 120  # of a line


def robots_command(
    robot: Annotated[
        str | None, typer.Argument(metavar="[ROBOT]", help="with -o: a shipped robot, or a CSV table of DH rows")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="folder for its robot.toml and cells, to be made your own"),
    ] = None,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """List the robots and cells that come with the planner, or copy one as a start for your own."""
    if (robot is None) != (output is None):
        raise InputError("a robot is copied by its name and a folder together: edbb robots kuka-kr6-r700 -o mine")
    if robot is not None and output is not None:
        _copy(robot, output, manner.force)
        return
    from planner.cell.reading import shipped_cells
    from planner.kinematics.robot_reader import list_robots, load_robot

    robots = {name: load_robot(name) for name in list_robots()}
    cells = {name: [c for c in shipped_cells() if c.startswith(f"{name}/")] for name in robots}
    if as_json:
        print_json(
            [
                {"name": name, "title": r.title, "joints": r.n_joints, "cells": cells[name], "payload_kg": r.payload}
                for name, r in robots.items()
            ]
        )
        return
    table = Table("robot", "title", "joints", "payload", "cells", box=None)
    for name, r in robots.items():
        payload = "" if r.payload is None else f"{r.payload:g} kg"
        table.add_row(name, make_printable(r.title), str(r.n_joints), payload, ", ".join(cells[name]))
    SafeConsole(width=WIDE_SIGNS).print(table)


def _copy(robot: str, output: Path, force: bool) -> None:
    """Write the files of a robot, and say what they lack and what comes next."""
    from planner.kinematics.robot_reader import describe_robot
    from planner.workflow.robot_copy import ROBOT_FILE, copy_robot

    files = copy_robot(robot, output, force)
    facts = [("written to", f"{output}: {', '.join(f.name for f in files)}")]
    cells = [f for f in files if f.name != ROBOT_FILE]
    if not describe_robot(files[0]).bodies:
        bare = f"no collision check would see this arm: add [[bodies]] to {files[0]}, a capsule a link"
        facts.append(("no bodies", f"{bare} (how to guess them: docs/tutorials/kuka-bar.md)"))
    if not cells:
        facts.append(("no cell", f'write one beside it (docs/how-to/cell.md), with robot = "{ROBOT_FILE}"'))
    errors.print("\n".join(fact_lines(facts)))
    what = f"{ROBOT_FILE} and the cell" if cells else ROBOT_FILE
    cell = cells[0] if cells else output / "cell.toml"
    print_next(f"change {what} into yours, then: edbb plan {as_word(cell)} -o plan")


def dialects_command(as_json: Json = False) -> None:
    """List the robot languages that programs can be written in."""
    from planner.programs.dialect import dialects

    if as_json:
        print_json(
            [
                {
                    "name": i.name,
                    "title": i.title,
                    "units": i.units,
                    "max_joints": i.max_joints,
                    "resolution_deg": float(10.0**-i.decimals),
                    "logs_at_rest": i.logs_axes,
                    "logs_in_passing": i.logs_passing,
                    "trace": i.trace,
                }
                for i in dialects()
            ]
        )
        return
    table = Table("dialect", "title", "axes", "resolution", "blending", "logs its axes", box=None)
    for i in dialects():
        axes = f"{i.min_joints}–{i.max_joints}"
        table.add_row(i.name, make_printable(i.title), axes, f"{10.0**-i.decimals:g}°", i.blend.kind, i.logging)
    SafeConsole(width=WIDE_SIGNS).print(table)
