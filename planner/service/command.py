"""The command serve."""

import os
import threading
import webbrowser
from collections.abc import Sequence
from http.client import HTTPConnection, HTTPException
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.terminal import environment_token, errors, results
from planner.common.errors import InputError, MissingProgramError
from planner.service.settings import (
    GB,
    ClusterSettings,
    ProxySettings,
    Quota,
    Retention,
    Role,
    ServiceSettings,
    WebhookSettings,
    default_folder,
    machine_memory,
    share_memory,
)

if TYPE_CHECKING:
    from planner.service.people_command import UserOptions

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="ACTION",
        help="backup FOLDER: copy the store, in use or not; restore FOLDER: bring a copy back; keys FOLDER: make the "
        "keys of a cluster; users ...: who may "
        "log in (add NAME, list, passwd NAME, role NAME, remove NAME, token NAME, untoken NAME)",
        show_default=False,
    ),
]
Data = Annotated[
    Path | None, typer.Option(metavar="DIR", help="where jobs and files are kept (default: ~/.local/share/edbb)")
]
Host = Annotated[str, typer.Option(help="address to listen on; beyond this machine people have to log in")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="0: any free one")]
Names = Annotated[list[str] | None, typer.Option(help="a further name of this host; may be repeated")]
Workers = Annotated[int | None, typer.Option(min=1, help="most jobs at a time (default: one a core)")]
MemoryGb = Annotated[float | None, typer.Option(min=0.25, help="memory of one job")]
Minutes = Annotated[float, typer.Option(min=0.05, help="time of one job")]
KeepDays = Annotated[float | None, typer.Option(min=1, help="jobs that ended longer ago are deleted (default: none)")]
KeepGb = Annotated[
    float | None, typer.Option(min=0.1, help="the oldest jobs are deleted while files are larger (default: none)")
]
Proxy = Annotated[
    list[str] | None,
    typer.Option(metavar="ADDRESS", help="proxy or network of proxies whose X-Forwarded-For is believed"),
]
ProxyUser = Annotated[
    str, typer.Option(metavar="HEADER", help="header in which that proxy names who has logged in there")
]
ProxyRole = Annotated[
    Role | None, typer.Option(help="what people may do whom the proxy names and nobody added (default: nothing)")
]
PersonJobs = Annotated[int | None, typer.Option(min=1, help="most jobs of one person that wait or run")]
PersonGb = Annotated[float | None, typer.Option(min=0.001, help="most files of one person")]
ClusterAddress = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers compute the jobs, such as tls://host:8786")
]
ClusterKeys = Annotated[
    Path | None, typer.Option(metavar="DIR", help="keys of that cluster; 'edbb serve keys DIR' makes them")
]
ClusterUrl = Annotated[str, typer.Option(metavar="URL", help="by which those workers reach this service")]
Webhook = Annotated[
    list[str] | None, typer.Option(metavar="URL", help="gets a message when a job ends (signed by EDBB_WEBHOOK_SECRET)")
]
WebhookPrivate = Annotated[bool, typer.Option("--webhook-private", help="webhooks may lie in private networks")]
RootPath = Annotated[str, typer.Option(metavar="PATH", help="where a proxy has the service on its host, such as /edbb")]
AccessLogFile = Annotated[str, typer.Option(metavar="FILE", help="log of accesses; - for standard error")]
RoleOption = Annotated[Role | None, typer.Option(help="users add, role: what the person may do (default: work)")]
Label = Annotated[str, typer.Option(help="users token, untoken: what the token is for")]
SamePerson = Annotated[bool, typer.Option("--same-person", help="users add: who had this name before is back")]
NoPassword = Annotated[bool, typer.Option("--no-password", help="users add: a token or a proxy lets the person in")]
Open = Annotated[bool, typer.Option("--open", help="show the page in a browser; the one that is served there already")]


def serve_command(
    what: Words = None,
    data: Data = None,
    host: Host = "127.0.0.1",
    port: Port = 8017,
    name: Names = None,
    workers: Workers = None,
    memory_gb: MemoryGb = None,
    minutes: Minutes = 120.0,
    keep_days: KeepDays = None,
    keep_gb: KeepGb = None,
    proxy: Proxy = None,
    proxy_user: ProxyUser = "",
    proxy_role: ProxyRole = None,
    person_jobs: PersonJobs = None,
    person_gb: PersonGb = None,
    cluster: ClusterAddress = "",
    cluster_url: ClusterUrl = "",
    cluster_keys: ClusterKeys = None,
    webhook: Webhook = None,
    webhook_private: WebhookPrivate = False,
    access_log: AccessLogFile = "",
    root_path: RootPath = "",
    role: RoleOption = None,
    label: Label = "program",
    no_password: NoPassword = False,
    same_person: SamePerson = False,
    open_page: Open = False,
) -> None:
    """Serve the planner to browsers and programs: robots, plans, calibrations, as jobs that survive a crash."""
    import_service()
    from planner.service.people_command import UserOptions
    from planner.service.serving import serve, start_notices

    store = (data or default_folder()).resolve()
    if what:
        act(what, UserOptions(role, label, no_password, same_person), store)
    if what or (open_page and show_other_service(host, port)):
        return
    most = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    shares = share_memory(most, None if memory_gb is None else int(memory_gb * GB), machine_memory())
    for notice in start_notices(None if cluster else workers, shares):
        errors.print(notice)
    settings = ServiceSettings(
        folder=store,
        host=host,
        port=port,
        names=tuple(name or ()),
        token=environment_token(),
        workers=workers or shares.workers if cluster else shares.workers,
        beside=shares.beside,
        limits=shares.limits(minutes * 60),
        kept=Retention.of(keep_days, keep_gb),
        proxy=ProxySettings(tuple(proxy or ()), proxy_user, proxy_role),
        quota=Quota(person_jobs, None if person_gb is None else int(person_gb * GB)),
        cluster=ClusterSettings(cluster, cluster_url, cluster_keys),
        webhooks=WebhookSettings(tuple(webhook or ()), webhook_private, os.environ.get("EDBB_WEBHOOK_SECRET", "")),
        access_log=access_log,
        root_path=root_path,
    )
    serve(settings, lambda address: announce(address, settings.folder, open_page))


def announce(address: str, folder: Path, open_page: bool) -> None:
    """Say that the service can be asked, and show its page if that was asked for."""
    errors.print(f"serving at {address}, jobs and files in {folder}")
    if open_page:  # requests wait until the server takes them
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()


def show_other_service(host: str, port: int) -> bool:
    """Show the page of the service that answers there already, as somebody has started it twice; tell whether."""
    try:
        there = HTTPConnection(host, port, timeout=2)  # [s]; it is this machine
        there.request("GET", "/api/health")
        if b"jobs_waiting" not in there.getresponse().read():
            return False
    except (OSError, HTTPException):
        return False
    errors.print(f"served already at http://{host}:{port}")
    webbrowser.open(f"http://{host}:{port}")
    return True


def act(words: Sequence[str], options: "UserOptions", store: Path) -> None:
    """Do what is asked for in place of serving: about people, the keys of a cluster, or a copy of the store.

    Raises:
        PlannerError: as the action raises it.
    """
    from planner.service.people_command import change_people

    if words[0] == "users":
        change_people(words[1:], options, store, errors.print, typer.echo)
    elif words[0] == "keys":
        make_keys(words[1:])
    else:
        copy_store(words, store)


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


def make_keys(words: Sequence[str]) -> None:
    """Make the keys of a cluster in a folder.

    Raises:
        InputError: not one folder is named, or it has keys already.
        MissingProgramError: the package that makes them is not installed.
    """
    from planner.service.cluster_keys import make_cluster_keys

    if len(words) != 1:
        raise InputError("edbb serve keys FOLDER: name one folder, which is copied to each machine of the cluster")
    files = ", ".join(path.name for path in make_cluster_keys(Path(words[0])))
    results.print(
        f"written to {words[0]}: {files}; who has this folder may run programs on the cluster: copy it to the machines "
        "of the cluster alone"
    )


def copy_store(words: Sequence[str], store: Path) -> None:
    """Copy the store of a service into a folder, or bring such a copy back.

    Raises:
        InputError: the words say something else, or one of the two folders is not what it should be.
    """
    from planner.service.backup import back_up, restore

    what, folders = words[0], words[1:]
    if what not in ("backup", "restore") or len(folders) != 1:
        raise InputError(
            f"edbb serve {' '.join(words)}: say 'backup FOLDER' or 'restore FOLDER' with the folder of the copy, "
            "'keys FOLDER' or 'users list'"
        )
    folder = Path(folders[0])
    done = back_up(store, folder) if what == "backup" else restore(folder, store)
    where = f"copied to {folder}" if what == "backup" else f"brought back to {store}"
    results.print(f"{done.jobs} jobs, {done.files} files and {done.robots} robots {where}")
