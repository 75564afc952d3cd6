"""The command serve."""

import os
import threading
import webbrowser
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.declared import Values, declare_command, new_folder
from planner.cli.terminal import environment_token, errors, results
from planner.common.calls import Call, Option
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

Texts = list[str] | None


@dataclass(frozen=True)
class ServeCall(Call):
    """Serve the planner to browsers and programs: robots, plans, calibrations, as jobs that survive a crash."""

    verb = "serve"
    needs_output = False

    what: Annotated[
        Sequence[str],
        Option(
            "backup FOLDER: copy the store, in use or not; restore FOLDER: bring a copy back; keys FOLDER: make the "
            "keys of a cluster; users ...: who may "
            "log in (add NAME, list, passwd NAME, role NAME, remove NAME, token NAME, untoken NAME)",
            metavar="ACTION", is_word=True, typed=list[str] | None,
        ),
    ] = ()  # fmt: skip
    data: Annotated[
        Path | None, Option("where jobs and files are kept (default: ~/.local/share/edbb)", metavar="DIR")
    ] = None
    host: Annotated[str, Option("address to listen on; beyond this machine people have to log in")] = "127.0.0.1"
    port: Annotated[int, Option("0: any free one", min=0, max=65535)] = 8017
    name: Annotated[Sequence[str], Option("a further name of this host; may be repeated", typed=Texts)] = ()
    workers: Annotated[int | None, Option("most jobs at a time (default: one a core)", min=1)] = None
    memory_gb: Annotated[float | None, Option("memory of one job", min=0.25)] = None
    minutes: Annotated[float, Option("time of one job", min=0.05)] = 120.0
    keep_days: Annotated[float | None, Option("jobs that ended longer ago are deleted (default: none)", min=1)] = None
    keep_gb: Annotated[
        float | None, Option("the oldest jobs are deleted while files are larger (default: none)", min=0.1)
    ] = None
    proxy: Annotated[
        Sequence[str],
        Option("proxy or network of proxies whose X-Forwarded-For is believed", metavar="ADDRESS", typed=Texts),
    ] = ()
    proxy_user: Annotated[str, Option("header in which that proxy names who has logged in there", metavar="HEADER")] = (
        ""
    )
    proxy_role: Annotated[
        Role | None, Option("what people may do whom the proxy names and nobody added (default: nothing)")
    ] = None
    person_jobs: Annotated[int | None, Option("most jobs of one person that wait or run", min=1)] = None
    person_gb: Annotated[float | None, Option("most files of one person", min=0.001)] = None
    cluster: Annotated[
        str, Option("Dask scheduler whose workers compute the jobs, such as tls://host:8786", metavar="ADDRESS")
    ] = ""
    cluster_url: Annotated[str, Option("by which those workers reach this service", metavar="URL")] = ""
    cluster_keys: Annotated[
        Path | None, Option("keys of that cluster; 'edbb serve keys DIR' makes them", metavar="DIR")
    ] = None
    webhook: Annotated[
        Sequence[str],
        Option("gets a message when a job ends (signed by EDBB_WEBHOOK_SECRET)", metavar="URL", typed=Texts),
    ] = ()
    webhook_private: Annotated[bool, Option("webhooks may lie in private networks")] = False
    access_log: Annotated[str, Option("log of accesses; - for standard error", metavar="FILE")] = ""
    root_path: Annotated[str, Option("where a proxy has the service on its host, such as /edbb", metavar="PATH")] = ""
    role: Annotated[Role | None, Option("users add, role: what the person may do (default: work)")] = None
    label: Annotated[str, Option("users token, untoken: what the token is for")] = "program"
    no_password: Annotated[bool, Option("users add: a token or a proxy lets the person in")] = False
    same_person: Annotated[bool, Option("users add: who had this name before is back")] = False
    open_page: Annotated[
        bool, Option("show the page in a browser; the one that is served there already", flag="--open")
    ] = False


def _serve(values: Values, **_: object) -> None:
    import_service()
    from planner.service.people_command import UserOptions
    from planner.service.serving import serve, start_notices

    asked = ServeCall(**values)
    store = (asked.data or default_folder()).resolve()
    if asked.what:
        act(asked.what, UserOptions(asked.role, asked.label, asked.no_password, asked.same_person), store)
        return
    port = free_port(asked.host, asked.port) if asked.open_page and asked.port else asked.port
    if port is None:
        return
    workers = asked.workers
    most = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    shares = share_memory(most, _bytes(asked.memory_gb), machine_memory())
    for notice in start_notices(None if asked.cluster else workers, shares):
        errors.print(notice)
    secret = os.environ.get("EDBB_WEBHOOK_SECRET", "")
    settings = ServiceSettings(
        folder=store,
        host=asked.host,
        port=port,
        names=tuple(asked.name),
        token=environment_token(),
        workers=workers or shares.workers if asked.cluster else shares.workers,
        beside=shares.beside,
        limits=shares.limits(asked.minutes * 60),
        kept=Retention.of(asked.keep_days, asked.keep_gb),
        proxy=ProxySettings(tuple(asked.proxy), asked.proxy_user, asked.proxy_role),
        quota=Quota(asked.person_jobs, _bytes(asked.person_gb)),
        cluster=ClusterSettings(asked.cluster, asked.cluster_url, asked.cluster_keys),
        webhooks=WebhookSettings(tuple(asked.webhook), asked.webhook_private, secret),
        access_log=asked.access_log,
        root_path=asked.root_path,
    )
    serve(settings, lambda address: announce(address, settings.folder, asked.open_page))


serve_command = declare_command(ServeCall, _serve, new_folder)


def _bytes(gigabytes: float | None) -> int | None:
    return None if gigabytes is None else int(gigabytes * GB)


def announce(address: str, folder: Path, open_page: bool) -> None:
    """Say that the service can be asked, and show its page if that was asked for."""
    errors.print(f"serving at {address}, jobs and files in {folder}")
    if open_page:  # requests wait until the server takes them
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()


def free_port(host: str, port: int) -> int | None:
    """Return the first port from ``port`` on at which nobody answers; None where this service does, which it shows."""
    for there in range(port, port + 10):  # 10: ports that other programs may have
        asked = HTTPConnection(host, there, timeout=2)  # [s]; it is this machine
        try:
            asked.connect()
        except OSError:
            return there
        with closing(asked), suppress(OSError, HTTPException):  # what is no server of pages is another program
            asked.request("GET", "/api/health")
            if b"jobs_waiting" in asked.getresponse().read():
                errors.print(f"served already at http://{host}:{there}")
                webbrowser.open(f"http://{host}:{there}")
                return None
    return port


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
