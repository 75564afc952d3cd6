"""The command ``edbb``: its verbs, each loaded when it is called; a failure ends in one sentence and its exit code."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from planner import __version__
from planner.cli.command_groups import group_of, in_order
from planner.cli.declared import folder_command
from planner.cli.terminal import TELLING, errors
from planner.common.console import speak_plainly
from planner.common.errors import InputError, PlannerError
from planner.common.files import INPUTS, OVERWRITING, short_path
from planner.common.quiet import results_alone
from planner.kinematics.packages import COMMAND_PACKAGES
from planner.workflow.verbs import DECLARED

PLANNING, CALIBRATION, CELL, SERVICE = "plan_commands", "calibration_commands", "cell_commands", "service_commands"
WRITTEN = {  # not declared: (module, line in the list of commands)
    "record": (CALIBRATION, "Keep the history of one robot, and show its drift."),
    "centre": (CELL, "Centre a head of indicators on the balls of a plan."),
    "measure": (CELL, "Read a bar or wire at each pose of a plan into a run."),
    "demo": ("demo_command", "Try the whole chain without a robot, on one with a hidden fault."),
    "serve": (SERVICE, "Serve the planner to browsers and programs."),
    "robots": (SERVICE, "List the robots and cells that come with the planner."),
    "dialects": (SERVICE, "List the robot languages that programs can be written in."),
}
VERBS = {name: call.line for name, call in DECLARED.items()} | {name: line for name, (_, line) in WRITTEN.items()}
"""Every command, and its line in the list."""
WITH_MORE = {  # declared, and more than that happens, or is typed, on the command line: the module
    **dict.fromkeys(("study", "export"), PLANNING),
    **dict.fromkeys(("simulate", "import", "compensate"), CALIBRATION),
}


class PlainSwitches:
    """A command whose help shows no type behind its switches: they take no value."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, switches without a type."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for parameter in parameters:
            if getattr(parameter, "is_flag", False):
                parameter.metavar = ""
        return parameters


class Verb(PlainSwitches, TyperCommand):
    """One command."""


Force = Annotated[bool, typer.Option("--force", help="write over files that somebody else has written")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="say more: every number, the proof, each note")]
PackageFolders = Annotated[
    list[str] | None,
    typer.Option("--package", metavar="NAME=DIR", help="folder of a ROS package that a URDF names; may be repeated"),
]
ROBOT_WORDS = {"cell", "unloaded", "model"}  # parameters that name a file with a robot


def with_shared_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command ``--verbose``, one that writes files ``--force``, one that reads a robot's file ``--package``."""
    plain = signature(function, eval_str=True)
    shared = [Parameter("verbose", Parameter.KEYWORD_ONLY, default=False, annotation=Verbose)]
    if "output" in plain.parameters:
        shared.append(Parameter("force", Parameter.KEYWORD_ONLY, default=False, annotation=Force))
    if ROBOT_WORDS & plain.parameters.keys():
        shared.append(Parameter("package", Parameter.KEYWORD_ONLY, default=None, annotation=PackageFolders))

    @wraps(function)
    def wrapped(
        *, verbose: bool = False, force: bool = False, package: list[str] | None = None, **values: object
    ) -> None:
        TELLING.all = verbose
        OVERWRITING.allowed = force
        COMMAND_PACKAGES.set(package or ())
        function(**values)

    parameters = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in plain.parameters.values()]
    wrapped.__signature__ = plain.replace(parameters=[*parameters, *shared])  # type: ignore[attr-defined]
    wrapped.__annotations__ = {p.name: p.annotation for p in (*parameters, *shared)}
    return wrapped


class Verbs(PlainSwitches, TyperGroup):
    """The list of all verbs, and the one that is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for name in in_order(list(VERBS)):
            self.add_command(TyperCommand(name, help=VERBS[name], rich_help_panel=group_of(name)))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and other words of what is called."""
        name, command, words = super().resolve_command(ctx, args)
        return name, None if name is None or command is None else load_command(name), words


def command_function(name: str) -> Callable[..., None]:
    """Return the function of the command ``name``."""
    if name in DECLARED and name not in WITH_MORE:
        return folder_command(DECLARED[name])
    module = import_module(f"planner.cli.{WITH_MORE.get(name) or WRITTEN[name][0]}")
    function: Callable[..., None] = getattr(module, f"{name.replace('-', '_')}_command")
    return function


def load_command(name: str) -> Any:
    """Return the command ``name``, with the libraries that it needs."""
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(name, cls=Verb)(with_shared_options(command_function(name)))
    return typer.main.get_command(alone)


app = typer.Typer(
    name="edbb",
    cls=Verbs,
    help="Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def root(
    version: Annotated[bool, typer.Option("--version", help="print the version")] = False,
    server: Annotated[
        str | None, typer.Option(metavar="URL", help="run the command on an edbb serve (token: EDBB_TOKEN)")
    ] = None,
) -> None:
    """Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot."""
    if version:
        typer.echo(f"edbb {__version__}")
        raise typer.Exit


OUTPUT_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF, errno.EPIPE)
ASKS = ("--help", "--version")


def _run_on_server(url: str, words: list[str]) -> int:
    """Check the command here, so that nothing is sent in vain, and run it there."""
    from planner.cli.remote import Server, run_remotely

    if words[0] not in VERBS:
        app(words)
    if not url.startswith(("http://", "https://")):
        raise InputError(f"--server '{url}': an address such as http://127.0.0.1:8017 is needed")
    try:
        load_command(words[0]).make_context(words[0], list(words[1:]))
    except Exception as err:  # of the library that reads the command line: it is vendored and has no public name
        if not hasattr(err, "show"):
            raise
        err.show()
        return int(getattr(err, "exit_code", 2))
    return run_remotely(Server(url.rstrip("/"), os.environ.get("EDBB_TOKEN", "")), words)


def main() -> None:
    """Run the command line; the exit code is the error's own (0 done, 1 bug, 2 input, 3 no solution, 4 missing)."""
    speak_plainly()
    try:
        with results_alone():
            _run_and_flush()
    except PlannerError as err:
        errors.print(f"edbb: {err}")
        sys.exit(err.exit_code)
    except OSError as err:
        if not err.filename and err.errno not in OUTPUT_FAILURES:
            raise
        if not err.filename:  # what is left of standard output goes nowhere when the process ends
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(err, BrokenPipeError):
            what = (
                f"{short_path(Path(err.filename))}: cannot be used" if err.filename else "the output cannot be written"
            )
            errors.print(f"edbb: {what} ({err.strerror or err})")
        sys.exit(InputError.exit_code)


def _run_and_flush() -> None:
    """Run what is called; what is left of standard output is written here, where its failure can be told."""
    try:
        with INPUTS.watch():
            if len(sys.argv) > 3 and sys.argv[1] == "--server" and sys.argv[3] not in ASKS:
                sys.exit(_run_on_server(sys.argv[2], sys.argv[3:]))
            app(standalone_mode=True)
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()
