"""The command ``edbb``: its verbs, each loaded when it is called; a failure ends in one sentence and its exit code."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from planner import __version__
from planner.cli.declared import folder_command
from planner.cli.terminal import Manner, errors
from planner.common.calls import GROUPS, MORE
from planner.common.commands import extension_commands, remote_function
from planner.common.console import encode_output
from planner.common.errors import InputError, LookFirst, MissingProgramError, PlannerError
from planner.common.exchange import short_path
from planner.common.extensions import broken_extensions
from planner.common.files import INPUTS
from planner.common.quiet import results_alone
from planner.common.system import expand_stars
from planner.kinematics.packages import COMMAND_PACKAGES
from planner.workflow.verbs import CORE, declared_calls

HELP = {"help_option_names": ["-h", "--help"]}
LISTS = "planner.cli.list_commands"
WRITTEN = {  # of the core, not declared: the function of the command line, and the line in the list of commands
    "robots": (f"{LISTS}:robots_command", "List the robots and cells that come with the planner."),
    "dialects": (f"{LISTS}:dialects_command", "List the robot languages that programs can be written in."),
    "demo": (
        "planner.cli.demo_command:demo_command",
        "Try the whole chain without a robot, on one with a hidden fault.",
    ),
}
WITH_MORE = {  # of the core, declared, and more than that happens, or is typed, on the command line: the function
    "export": "planner.cli.calibration_commands:export_command",
    **{n: f"planner.cli.calibration_commands:{n}_command" for n in ("simulate", "import", "compensate")},
}


@cache
def verbs() -> dict[str, str]:
    """Return every command, and its line in the list: heading by heading, those of the core first.

    Raises:
        DeclarationError: a command of the core is declared wrongly.
    """
    declared = {name: call.line for name, call in declared_calls().items()}
    more = {name: c.line for name, c in extension_commands().items()}
    own = {name: line for name, (_, line) in WRITTEN.items()}
    every, groups = more | declared | own, command_groups()
    return dict(sorted(every.items(), key=lambda item: GROUPS.index(groups[item[0]])))


def command_groups() -> dict[str, str]:
    """Return under which heading the list of commands shows each."""
    declared = {name: call.group for name, call in declared_calls().items()}
    return {name: c.group for name, c in extension_commands().items()} | declared | dict.fromkeys(WRITTEN, MORE)


def of_core(name: str) -> bool:
    """Tell whether a command is of the core; then no extension can take it."""
    return name in WRITTEN or name in {call.verb for call in CORE}


def describe_left_out() -> list[str]:
    """Say what of the extensions could not be used, a sentence each."""
    taken = [
        f"command '{name}': an extension ({c.module}) brings it, and the planner has it already"
        for name, c in extension_commands().items()
        if of_core(name)
    ]
    return [*(broken.said for broken in broken_extensions()), *taken]


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
    """A command of ``edbb``."""


Force = Annotated[bool, typer.Option("--force", help="write over files that somebody else has written")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="say more: every number, the proof, each note")]
PackageFolders = Annotated[
    list[str] | None,
    typer.Option("--package", metavar="NAME=DIR", help="folder of a ROS package that a URDF names; may be repeated"),
]
ROBOT_WORDS = {"cell", "unloaded", "model"}  # parameters that name a file with a robot


def with_shared_options(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command ``--verbose``, one that writes files ``--force``, one that reads a robot's file ``--package``.

    A function that has the parameter ``manner`` is handed the values of the first two in it.
    """
    plain = signature(function, eval_str=True)
    told = "manner" in plain.parameters
    shared = [Parameter("verbose", Parameter.KEYWORD_ONLY, default=False, annotation=Verbose)]
    if "output" in plain.parameters:
        shared.append(Parameter("force", Parameter.KEYWORD_ONLY, default=False, annotation=Force))
    if ROBOT_WORDS & plain.parameters.keys():
        shared.append(Parameter("package", Parameter.KEYWORD_ONLY, default=None, annotation=PackageFolders))

    @wraps(function)
    def wrapper(
        *, verbose: bool = False, force: bool = False, package: list[str] | None = None, **values: object
    ) -> None:
        """Run the command with its own values; packages and manner are settled before."""
        COMMAND_PACKAGES.set(package or ())
        function(**values, **({"manner": Manner(verbose, force)} if told else {}))

    own = (p for n, p in plain.parameters.items() if n != "manner")
    parameters = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in own]
    wrapper.__signature__ = plain.replace(parameters=[*parameters, *shared])  # type: ignore[attr-defined]
    wrapper.__annotations__ = {p.name: p.annotation for p in (*parameters, *shared)}
    return wrapper


class Verbs(PlainSwitches, TyperGroup):
    """The list of all verbs, and the one that is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for name, line in verbs().items():
            self.add_command(TyperCommand(name, help=line, rich_help_panel=command_groups()[name]))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and other words of what is called."""
        name, command, words = super().resolve_command(ctx, args)
        return name, None if name is None or command is None else load_command(name), words


def command_function(name: str) -> Callable[..., None]:
    """Return the function of the command ``name``."""
    brought = None if of_core(name) else extension_commands().get(name)
    if brought:
        brought.check()
    typed = brought.typed if brought else WITH_MORE.get(name) or WRITTEN.get(name, ("",))[0]
    if not typed:
        return folder_command(declared_calls()[name])
    module, attribute = typed.split(":")
    function: Callable[..., None] = getattr(import_module(module), attribute)
    return function


def load_command(name: str) -> Any:
    """Return the command ``name``, with the libraries that it needs."""
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(name, cls=Verb, context_settings=HELP)(with_shared_options(command_function(name)))
    return typer.main.get_command(alone)


app = typer.Typer(
    name="edbb",
    cls=Verbs,
    help="Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot.",
    context_settings=HELP,
    pretty_exceptions_enable=False,
)


GREETING = """\
Plans a measurement that calibrates your robot, finds how far the robot is off and why, and corrects its programs.
Try the whole chain without a robot:  edbb demo
See all commands:                     edbb -h"""


@app.callback(invoke_without_command=True)
def root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="print the version")] = False,
    server: Annotated[
        str | None,
        typer.Option(metavar="URL", help="run the command on a server of the planner (EDBB_TOKEN, EDBB_TOKEN_FILE)"),
    ] = None,
) -> None:
    """Plans measurements that calibrate industrial robots with simple gauges, and identifies the robot."""
    if version:
        typer.echo(f"edbb {__version__}")
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        typer.echo(GREETING)


OUTPUT_FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF, errno.EPIPE)
ASKS = ("-h", "--help", "--version")


def _run_on_server(url: str, words: list[str]) -> int:
    """Check the command here, so that nothing is sent in vain, and run it there."""
    if words[0] not in verbs():
        app(words)
    if not url.startswith(("http://", "https://")):
        raise InputError(f"--server '{url}': an address such as http://127.0.0.1:8017 is needed")
    if not remote_function():
        raise MissingProgramError("--server: no extension that is installed here runs commands on a server")
    try:
        typed = load_command(words[0]).make_context(words[0], list(words[1:])).params
    except Exception as err:  # of the library that reads the command line: it is vendored and has no public name
        if not hasattr(err, "show"):
            raise
        err.show()
        return int(getattr(err, "exit_code", 2))
    find_output = getattr(command_function(words[0]), "find_output", None)
    if find_output is not None and typed.get("output") is None:
        words = [*words, "-o", str(find_output(typed))]
    module, name = remote_function().split(":")
    run: Callable[[str, list[str]], int] = getattr(import_module(module), name)
    return run(url, words)


def main() -> None:
    """Run the command line; the exit code is the error's own (docs/formats.md)."""
    encode_output()
    ended = ""
    try:
        with results_alone():
            _run_and_flush()
    except PlannerError as err:
        ended = str(err)
        errors.print(ended if isinstance(err, LookFirst) else f"edbb: {err}")
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
    finally:
        for said in describe_left_out():
            if said != ended:
                errors.print(f"edbb: left out: {said}")


def _run_and_flush() -> None:
    """Run what is called; what is left of standard output is written here, where its failure can be told."""
    try:
        with INPUTS.watch():
            words = expand_stars(sys.argv[1:])
            if len(words) > 2 and words[0] == "--server" and words[2] not in ASKS:
                sys.exit(_run_on_server(words[1], words[2:]))
            app(words, standalone_mode=True)
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()
