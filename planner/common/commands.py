"""The commands that extensions bring, and the names that these give to the package.

A module that an extension registers must load no library of numbers: the list of commands is shown quickly. What does
the work is named as ``module:name``, and imported when it is called.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from planner.common.calls import MORE, Call, call_fields, check_call, check_group
from planner.common.errors import DeclarationError, MissingProgramError
from planner.common.extensions import shipped_extensions


@dataclass(frozen=True)
class Command:
    """A command beside those of the core.

    Attributes:
        name: as it is typed.
        line: what it does, in the list of all commands.
        call: its declaration; nothing where the command line alone has it.
        typed: ``module:name`` of the function of the command line, where more is typed than is declared, or nothing is.
        group: heading under which the list of commands shows it.
        needs: shipped extensions without which it does nothing, by their names.
    """

    name: str
    line: str
    call: type[Call] | None = None
    typed: str = ""
    group: str = MORE
    needs: tuple[str, ...] = ()

    @property
    def module(self) -> str:
        """The module that brings it."""
        return self.call.__module__ if self.call else self.typed.partition(":")[0]

    def check(self) -> None:
        """Refuse to run where an extension that it needs is left out.

        Raises:
            MissingProgramError: with the names of these.
        """
        there = {module.rpartition(".")[2] for module in shipped_extensions()}
        if absent := [name for name in self.needs if name not in there]:
            few = (
                f"extension {absent[0]}, which is" if len(absent) == 1 else f"extensions {', '.join(absent)}, which are"
            )
            raise MissingProgramError(f"edbb {self.name} needs the {few} not installed here")


_COMMANDS: dict[str, Command] = {}
_NAMES: dict[str, str] = {}
_REMOTE: list[str] = []


def register_command(name: str, line: str, typed: str, group: str = MORE, needs: tuple[str, ...] = ()) -> None:
    """Make a command known that the command line alone has.

    Args:
        name: as it is typed.
        line: what it does, in the list of all commands.
        typed: its function, as ``module:name``.
        group: heading under which the list shows it.
        needs: shipped extensions without which it does nothing, by their names.

    Raises:
        DeclarationError: the heading is unknown, or another extension has that command.
    """
    check_group(group, f"command '{name}'")
    _enter(Command(name, line, None, typed, group, needs))


def register_call(call: type[Call], typed: str = "", needs: tuple[str, ...] = ()) -> None:
    """Make a declared command known: to the command line, to the service and to the documentation.

    Args:
        call: its declaration.
        typed: the function of the command line as ``module:name``, where more is typed than is declared.
        needs: shipped extensions without which it does nothing, by their names.

    Raises:
        DeclarationError: the declaration is wrong, or another extension has that command.
    """
    check_call(call)
    if not typed and "progress" not in {f.name for f in call_fields(call)}:
        raise DeclarationError(
            f"{call.__module__}: {call.__name__} has no field progress, which the command line calls: "
            "'progress: ProgressKeyword = no_progress' is needed, behind the others"
        )
    _enter(Command(call.verb, call.line, call, typed, call.group, needs))


def _enter(command: Command) -> None:
    if command.name in _COMMANDS:
        raise DeclarationError(f"command '{command.name}': another extension has registered it already")
    _COMMANDS[command.name] = command


def register_names(module: str, *names: str) -> None:
    """Let the package ``planner`` have names of a module, which is imported when one is first used."""
    _NAMES.update(dict.fromkeys(names, module))


def register_remote(function: str) -> None:
    """Let ``edbb --server URL`` run a command by a function (``module:name``) of the address and the words."""
    _REMOTE.append(function)


def extension_commands() -> Mapping[str, Command]:
    """Return the commands that extensions have registered, by their names."""
    return _COMMANDS


def extension_names() -> Mapping[str, str]:
    """Return the module of each name that extensions give to the package."""
    return _NAMES


def remote_function() -> str:
    """Return the function that runs a command on a server, as ``module:name``; empty if no extension has one."""
    return _REMOTE[0] if _REMOTE else ""
