"""What comes with the planner: lists of robots and of robot languages."""

from rich.table import Table

from planner.cli.terminal import Json, SafeConsole, print_json
from planner.common.errors import printable

WIDE_SIGNS = 120  # of a line


def robots_command(as_json: Json = False) -> None:
    """List the robots and cells that come with the planner."""
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
        table.add_row(name, printable(r.title), str(r.n_joints), payload, ", ".join(cells[name]))
    SafeConsole(width=WIDE_SIGNS).print(table)


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
        table.add_row(i.name, printable(i.title), axes, f"{10.0**-i.decimals:g}°", i.blend.kind, i.logging)
    SafeConsole(width=WIDE_SIGNS).print(table)
