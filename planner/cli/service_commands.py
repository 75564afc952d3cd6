"""The command that serves the planner to browsers and programs: serve."""

import os
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import errors
from planner.common.errors import MissingProgramError

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
        from planner.service.serving import serve
    except ImportError as err:
        raise MissingProgramError(
            f"edbb serve needs {err.name}: pip install 'edbb-planner[service]' installs what it needs"
        ) from err
    from planner.service.settings import JobLimits, ServiceSettings, default_folder, default_memory

    most = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    memory = default_memory(most) if memory_gb is None else int(memory_gb * GB)
    settings = ServiceSettings(
        folder=(data or default_folder()).resolve(),
        host=host,
        port=port,
        names=tuple(name or ()),
        token=os.environ.get("EDBB_TOKEN", ""),
        workers=most,
        limits=JobLimits(memory, minutes * 60),
    )
    serve(settings, lambda address: errors.print(f"serving at {address}, jobs and files in {settings.folder}"))
