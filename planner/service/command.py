"""The command serve."""

import os
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import typer

from planner.cli.terminal import errors
from planner.common.errors import InputError, MissingProgramError
from planner.service.settings import GB


def serve_command(
    what: Annotated[
        Literal["backup", "restore"] | None,
        typer.Argument(help="backup: copy the store, in use or not; restore: bring a copy back", show_default=False),
    ] = None,
    folder: Annotated[Path | None, typer.Argument(metavar="FOLDER", help="of the copy", show_default=False)] = None,
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
    keep_days: Annotated[
        float | None, typer.Option(min=1, help="jobs that ended longer ago are deleted (default: none)")
    ] = None,
    keep_gb: Annotated[
        float | None,
        typer.Option(min=0.1, help="the oldest jobs are deleted while files are larger (default: none)"),
    ] = None,
) -> None:
    """Serve the planner to browsers and programs: robots, plans, calibrations, as jobs that survive a crash."""
    import_service()
    from planner.service.serving import serve, start_notices
    from planner.service.settings import Retention, ServiceSettings, default_folder, machine_memory, share_memory

    store = (data or default_folder()).resolve()
    if what is not None:
        copy_store(what, folder, store)
        return
    most = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    shares = share_memory(most, None if memory_gb is None else int(memory_gb * GB), machine_memory())
    for notice in start_notices(workers, shares):
        errors.print(notice)
    settings = ServiceSettings(
        folder=store,
        host=host,
        port=port,
        names=tuple(name or ()),
        token=os.environ.get("EDBB_TOKEN", ""),
        workers=shares.workers,
        beside=shares.beside,
        limits=shares.limits(minutes * 60),
        kept=Retention.of(keep_days, keep_gb),
    )
    serve(settings, lambda address: errors.print(f"serving at {address}, jobs and files in {settings.folder}"))


def import_service() -> None:
    """Import what the service needs.

    Raises:
        MissingProgramError: a package of it is not installed.
    """
    try:
        import_module("planner.service.serving")
    except ImportError as err:
        if str(err.name).startswith("planner."):
            raise MissingProgramError(f"edbb serve needs the extension that brings {err.name}") from err
        raise MissingProgramError(
            f"edbb serve needs {err.name}: pip install 'edbb-planner[service]' installs what it needs"
        ) from err


def copy_store(what: Literal["backup", "restore"], folder: Path | None, store: Path) -> None:
    """Copy the store of a service into a folder, or bring such a copy back.

    Raises:
        InputError: no folder is named, or one of the two is not what it should be.
    """
    from planner.service.backup import back_up, restore

    if folder is None:
        raise InputError(f"edbb serve {what} FOLDER: name the folder of the copy")
    done = back_up(store, folder) if what == "backup" else restore(folder, store)
    where = f"copied to {folder}" if what == "backup" else f"brought back to {store}"
    errors.print(f"{done.jobs} jobs, {done.files} files and {done.robots} robots {where}")
