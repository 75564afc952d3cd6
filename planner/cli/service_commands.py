"""What comes with the planner: lists of robots and of robot languages, and the service."""

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planner.cli.terminal import Json, SafeConsole, errors, print_json
from planner.common.errors import MissingProgramError, printable

GB = 1 << 30


def serve_command(
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="where jobs and files are kept (default: ~/.local/share/edbb)")
    ] = None,
    host: Annotated[str, typer.Option(help="address to listen on; beyond this machine EDBB_TOKEN must be set")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: any free one")] = 8017,
    name: Annotated[list[str] | None, typer.Option(help="a further name of this host; may be repeated")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="most jobs at a time (default: one a core)")] = None,
    memory_gb: Annotated[float | None, typer.Option(min=0.25, help="memory of one job")] = None,
    minutes: Annotated[float, typer.Option(min=0.05, help="time of one job")] = 120.0,
) -> None:
    """Serve the planner to browsers and programs: robots, plans, calibrations, as jobs that survive a crash."""
    try:
        from planner.service.serving import serve, start_notices
    except ImportError as err:
        raise MissingProgramError(
            f"edbb serve needs {err.name}: pip install 'edbb-planner[service]' installs what it needs"
        ) from err
    from planner.service.settings import JobLimits, ServiceSettings, default_folder, machine_memory, share_memory

    most = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    wanted = None if memory_gb is None else int(memory_gb * GB)
    shares = share_memory(most, wanted, machine_memory())
    for notice in start_notices(workers, shares):
        errors.print(notice)
    settings = ServiceSettings(
        folder=(data or default_folder()).resolve(),
        host=host,
        port=port,
        names=tuple(name or ()),
        token=os.environ.get("EDBB_TOKEN", ""),
        workers=shares.workers,
        beside=shares.beside,
        limits=JobLimits(shares.memory_bytes, minutes * 60),
    )
    serve(settings, lambda address: errors.print(f"serving at {address}, jobs and files in {settings.folder}"))


WIDE = 120  # signs of a line


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
    SafeConsole(width=WIDE).print(table)


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
    SafeConsole(width=WIDE).print(table)
