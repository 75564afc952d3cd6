"""What comes with the planner: lists of robots and of robot languages."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planner.cli.terminal import PLAINLY, Json, Manner, SafeConsole, print_json, print_next, results
from planner.common.console import as_word
from planner.common.errors import InputError, did_you_mean, make_printable
from planner.common.summary import fact_lines

WIDE_SIGNS = 120  # of a line


def robots_command(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT]", help="part of a name or title; with -o a robot to copy, or a CSV table of DH rows"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="folder for its robot.toml and cells, to be made your own"),
    ] = None,
    drawing: Annotated[
        Path | None,
        typer.Option("--draw", metavar="FILE.svg", help="draw the robot (a name or a robot.toml) with its lengths"),
    ] = None,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """List the robots and cells that come with the planner, copy one as a start for your own, or draw one."""
    if drawing is not None:
        _draw(robot, drawing, manner.force)
        return
    if output is not None:
        if robot is None:
            raise InputError("-o copies one robot: name it, as in edbb robots kuka-kr6-r700 -o mine")
        _copy(robot, output, manner.force)
        return
    from planner.cell.reading import shipped_cells
    from planner.kinematics.robot_reader import list_robots, load_robot

    robots = {name: load_robot(name) for name in list_robots()}
    if robot is not None:
        robots = {name: r for name, r in robots.items() if robot.lower() in f"{name} {r.title}".lower()}
        _check_name(robot, bool(robots), list(list_robots()))
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


def _draw(robot: str | None, drawing: Path, force: bool) -> None:
    """Write the drawing of a robot, by which its lengths are held against a data sheet."""
    from planner.common.files import write_together
    from planner.kinematics.robot_reader import load_robot
    from planner.report.robot_drawing import LEAST_MM, draw_robot, lengths

    if robot is None:
        raise InputError("--draw needs a robot: edbb robots kuka-kr6-r700 --draw arm.svg")
    known = load_robot(robot, Path())
    write_together([(drawing, draw_robot(known).encode())], force=force)
    shown = [
        [f"{abs(v):.4g} {way}" for v, way in zip(step, ("forward", "up"), strict=True) if abs(v) >= LEAST_MM]
        for step in lengths(known)
    ]
    steps = ", ".join(map(" and ".join, shown))
    results.print("\n".join(fact_lines([("drawn", str(drawing)), ("lengths", f"{steps} [mm], from base to flange")])))


def _check_name(asked: str, is_found: bool, known: list[str]) -> None:
    """Refuse a name that no shipped robot has, with what makes it one.

    Raises:
        InputError: there is none.
    """
    if asked.lower().endswith(".csv"):
        raise InputError(
            f"a table becomes a robot.toml in a folder: edbb robots {as_word(asked)} -o {as_word(Path(asked).stem)}"
        )
    if not is_found:
        raise InputError(
            f"robot '{asked}': none with this name or title is shipped{did_you_mean(asked, known)} Another arm starts "
            "as a copy of the one most like it: edbb robots ROBOT -o mine (docs/how-to/robot.md)"
        )


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
    results.print("\n".join(fact_lines(facts)))
    what = f"{ROBOT_FILE} and the cell" if cells else ROBOT_FILE
    cell = cells[0] if cells else output / "cell.toml"
    draw = f"edbb robots {as_word(files[0])} --draw {as_word(output / 'robot.svg')}"
    print_next(f"change {what} into yours; {draw} shows its lengths\nedbb plan {as_word(cell)} -o plan")


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
                    "resolution_deg": None if i.pulses else float(10.0**-i.decimals),
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
        resolution = "1 pulse" if i.pulses else f"{10.0**-i.decimals:g}°"
        table.add_row(i.name, make_printable(i.title), axes, resolution, i.blend.kind, i.logging)
    SafeConsole(width=WIDE_SIGNS).print(table)
