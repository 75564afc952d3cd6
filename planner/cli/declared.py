"""A command, made of the declaration of its verb.

Where a command writes when nobody names a place: a new folder or file, named after what the command works on.
"""

import re
from collections.abc import Callable, Mapping
from inspect import Parameter, Signature, getdoc
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
from typer.models import ArgumentInfo

from planner.cli.terminal import PLAINLY, Json, Manner, OptionalOutput, Output, give
from planner.common.calls import Call, CallField, find_function, typed_fields
from planner.common.errors import PARTLY_DONE

NAMED_BY_COMMAND = re.compile(r"^(plan|simulate|measure|centre|import|identify|check|plan-check)-(?=\w)")
FILES_BY_ROLE = {"plan", "cell", "run", "robot", "identification"}  # these names say nothing: the folder's name does


def new_folder(verb: str, subject: object) -> Path:
    """Return a folder that is not there yet, named after the command and its subject."""
    return Path(_free_name(f"{verb}{_subject_name(subject)}", ""))


def new_folder_of_files(verb: str, subject: object) -> str:
    """Return the same folder as text with a slash, for commands that take a file or a folder."""
    return f"{new_folder(verb, subject)}/"


def new_file(suffix: str) -> Callable[[str, object], str]:
    """Return the function that names a file that is not there yet; ``suffix`` begins with a dot."""
    return lambda verb, subject: _free_name(f"{verb}{_subject_name(subject)}", suffix)


def file_of(suffix: str) -> Callable[[str, object], str]:
    """Return the function that names a file, there or not: a session that was begun in it goes on."""
    return lambda verb, subject: f"{verb}{_subject_name(subject)}{suffix}"


def _free_name(base: str, suffix: str) -> str:
    number = 1
    while Path(name := f"{base}{f'-{number}' if number > 1 else ''}{suffix}").exists():
        number += 1
    return name


def _subject_name(subject: Any) -> str:
    """Return ``-NAME`` of a cell, run or plan; empty if there is none. A folder named by a command loses its verb."""
    first = subject[0] if isinstance(subject, list | tuple) and subject else subject
    if not first:
        return ""
    path = Path(str(first))
    if not path.exists() and not path.suffix:  # a shipped cell: robot/cell
        named = "-".join(path.parts)
    else:
        named = path.name if path.is_dir() else path.stem
        parent = path.resolve().parent.name
        named = parent if named in FILES_BY_ROLE and parent and path.parent != Path() else named
    named = re.sub(r"[^\w.-]+", "-", named).strip("-.")
    own = NAMED_BY_COMMAND.sub("", named)
    return f"-{own[:60]}" if own else ""  # 60: letters of a name


Values = Mapping[str, Any]
"""What was typed, by the names of the fields of a declaration."""


def declare_command(
    call: type[Call], work: Callable[..., None], name_output: Callable[[str, object], Any], **own: tuple[Any, Any]
) -> Callable[..., None]:
    """Return the function of a command, with the parameters that its declaration says and those that are its ``own``.

    Args:
        call: the declaration.
        work: what is done: it takes the values of the fields that were given, its own parameters by name, and the
            ``manner`` of the command.
        name_output: names what is written, of the command and its subject, where nobody names it.
        own: the parameters that the command line alone has, such as ``output``: annotation and default.
    """
    known = [_parameter(f) for f in typed_fields(call)]
    alone = [Parameter(n, Parameter.KEYWORD_ONLY, default=d, annotation=a) for n, (a, d) in own.items()]
    words = [p for p in known if isinstance(get_args(p.annotation)[1], ArgumentInfo) and p.name not in own]
    parameters = [*words, *alone, *(p for p in known if p not in words and p.name not in own)]

    def command(*, manner: Manner = PLAINLY, **values: Any) -> None:
        """Part what is declared from what the command line alone has, and do the work."""
        mine = {name: values.pop(name) for name in own} | {"manner": manner}
        if call.needs_output and mine["output"] is None:
            mine["output"] = find_output(values | mine)
        work({name: v for name, v in values.items() if v is not None and v != []}, **mine)

    def find_output(values: Mapping[str, Any]) -> Any:
        """Name what is written after the first word that was typed; of a study of no cell after its sweep."""
        subjects = (values.get(name) for name in (*(p.name for p in words), *own))
        return name_output(call.verb, next((s for s in subjects if isinstance(s, str | Path | list) and s), None))

    command.find_output = find_output  # type: ignore[attr-defined]  # a server is told it too
    command.__doc__ = getdoc(call)
    told = Parameter("manner", Parameter.KEYWORD_ONLY, default=PLAINLY, annotation=Manner)
    command.__signature__ = Signature([*parameters, told])  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


def complete_cell(incomplete: str) -> list[str]:
    """Return the shipped cells that begin with what is typed so far."""
    from planner.common.files import data_folder  # the help is quicker without

    cells = (f"{p.parent.parent.name}/{p.stem}" for p in data_folder("robots").glob("*/cells/*.toml"))
    return sorted(c for c in cells if c.startswith(incomplete))


def _parameter(field: CallField) -> Parameter:
    """Return a field as the library of the command line knows it; of a list nothing stands where nothing is typed."""
    option = field.option
    how: dict[str, Any] = {"help": option.help, "metavar": option.metavar, "min": option.min, "max": option.max}
    if option.metavar == "CELL":
        how["autocompletion"] = complete_cell
    note = typer.Argument(**how) if option.is_word else typer.Option(field.flag, **how)
    default = Parameter.empty if field.is_required else None if field.default == () else field.default
    kind: Any = field.kind if option.typed is None else option.typed
    return Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, note])


def folder_command(call: type[Call]) -> Callable[..., None]:
    """Return the command whose result is a folder."""

    def work(values: Values, output: Any, as_json: bool, manner: Manner) -> None:
        """Give the result of the declared function, written into a folder."""
        result = give(
            lambda stages: find_function(call)(**values, progress=stages.say), output, as_json, call.starts, manner
        )
        if result.cut_short:
            raise typer.Exit(PARTLY_DONE)

    output = (Output if call.needs_output else OptionalOutput, None)
    return declare_command(call, work, new_folder, output=output, as_json=(Json, False))
