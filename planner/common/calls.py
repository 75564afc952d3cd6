"""A verb is declared once: as a frozen dataclass, whose fields are all that it may be asked.

Python's signature and docstring, the command line, the requests over HTTP, the forms of the pages and the tables of
the documentation are made of that one declaration. To load one costs no library of numbers, so that the help is quick.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from functools import wraps
from inspect import Parameter, Signature, cleandoc, get_annotations
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, ParamSpec, TypeVar, get_args, get_origin

from planner.common.errors import DeclarationError, InputError, did_you_mean
from planner.common.notebook import runs_in_notebook, shown_progress
from planner.common.progress import Progress


@dataclass(frozen=True)
class JobFile:
    """What an earlier job of a service wrote: its kind, the folder that it is laid into, and the file that is meant.

    Without a file the folder itself is meant; ``also``: a kind of job that does as well.
    """

    kind: str
    folder: str
    file: str = ""
    also: str = ""

    @property
    def word(self) -> str:
        """By what a command names it."""
        return f"{self.folder}/{self.file}" if self.file else self.folder


SENT = "a file that a client has sent"


@dataclass(frozen=True)
class Option:
    """What is to be known of a field of a verb beside its type and its default.

    Attributes:
        help: a line for a person.
        min: least number that is allowed; ``max``: the largest.
        max_served: the largest number that a service takes.
        metavar: what stands for the value in the help.
        flag: its name on the command line, where that is not the field's.
        is_word: on the command line it is a word by itself, without a name.
        typed: type on the command line, where Python takes more than can be typed there.
        choices: of a text: a word for a person for each of its values; they stand in the forms.
        pattern: regular expression of a text that a service takes.
        request_name: its name in requests, where that is not the field's.
        from_service: what names a file in a request: ``SENT``, or the job that has written it; ``None``: requests
            have no such field.
        is_served: whether requests have the field.
        python_only: whether it can be given to the function alone.
        motion_key: of a plan: whether it stands for the key of its name under ``[motion]`` of the cell file.
    """

    help: str
    min: float | None = None
    max: float | None = None
    max_served: float | None = None
    metavar: str | None = None
    flag: str = ""
    is_word: bool = False
    typed: Any = None
    choices: Mapping[str, str] | None = None
    pattern: str | None = None
    request_name: str = ""
    from_service: JobFile | str | None = None
    is_served: bool = True
    python_only: bool = False
    motion_key: bool = False


def upload_option(help: str, metavar: str, request_name: str = "") -> Option:
    """Return the option of a file that may be left out; clients of a service send it."""
    return Option(help, metavar=metavar, typed=Path | None, request_name=request_name, from_service=SENT)


MORE = "More"
GROUPS = ("Plan", "Measure", "Calibrate", "Use", "Keep", MORE)
"""Headings under which the list of all commands shows each, in the order in which a person needs them."""


class Call:
    """Base of the declarations; the docstring is the help of the command."""

    verb: ClassVar[str]
    """The command."""
    line: ClassVar[str]
    """What it does, in the list of all commands."""
    group: ClassVar[str] = MORE
    """Under which heading the list of commands shows it, see :data:`GROUPS`."""
    function: ClassVar[str]
    """The function that does it, as ``module:name``; it is imported when it is called."""
    needs_output: ClassVar[bool] = True
    """Whether its result is always written, not only where a folder is named for it."""
    starts: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Share of the command's time at which each of its stages usually begins."""


LANGUAGE = "^[a-z0-9-]{1,40}$"  # name of a robot language
Seed = Annotated[int, Option("the same seed gives the same bytes", min=0, max_served=2**31)]
Dialects = Annotated[
    Sequence[str],
    Option(
        "robot language; may be repeated (default: those that the cell names)", typed=list[str] | None, pattern=LANGUAGE
    ),
]


ProgressKeyword = Annotated[
    Progress, Option("called with the stage, how much of it is done, and of how much", python_only=True)
]


@dataclass(frozen=True)
class CallField:
    """A field of a declaration: its name, its type in Python, and what a person must know of it (``option``)."""

    name: str
    kind: Any
    default: Any
    option: Option
    keyword: bool

    @property
    def is_required(self) -> bool:
        """Whether there is no call without it."""
        return self.default is MISSING

    @property
    def flag(self) -> str:
        """Its name on the command line."""
        return self.option.flag or f"--{self.name.replace('_', '-')}"

    @property
    def values(self) -> tuple[str, ...]:
        """All that it may be, where these are words."""
        parts = (self.kind, *get_args(self.kind))
        return get_args(next((p for p in parts if get_origin(p) is Literal), None))


def call_fields(call: type[Any]) -> tuple[CallField, ...]:
    """Return the fields of a declaration: those without a name first, those of Python alone last.

    Raises:
        DeclarationError: a field has no :class:`Option`, or its default lies outside its own bounds.
    """
    found = [_call_field(call, field) for field in fields(call)]
    return tuple(sorted(found, key=lambda f: (f.keyword, f.option.python_only)))


def _call_field(call: type[Any], field: Field[Any]) -> CallField:
    owner = next((c for c in call.__mro__ if field.name in get_annotations(c)), call)
    place = f"{owner.__module__}: {owner.__name__}.{field.name}"
    kind, *more = get_args(field.type) if get_origin(field.type) is Annotated else (field.type,)
    option = next((part for part in more if isinstance(part, Option)), None)
    if option is None:
        late = ", and the module without 'from __future__ import annotations'" if isinstance(field.type, str) else ""
        raise DeclarationError(f"{place}: its type has no Option: Annotated[TYPE, Option(HELP, …)] is needed{late}")
    if fault := _beyond_bounds(option, field.default):
        raise DeclarationError(f"{place}: its default is {field.default}, but {fault}; None leaves it to the cell")
    return CallField(field.name, kind, field.default, option, bool(field.kw_only))


def check_call(call: type[Call]) -> None:
    """Check what the list of commands and the command line need of a declaration.

    Raises:
        DeclarationError: the word, the line or the function is missing, the heading is unknown, or a field is wrong.
    """
    place = f"{call.__module__}: {call.__name__}"
    for name in ("verb", "line", "function"):
        if not isinstance(getattr(call, name, None), str):
            raise DeclarationError(f'{place}: {name} = "…" is missing')
    if call.function.count(":") != 1:
        raise DeclarationError(f"{place}: function = '{call.function}': 'module:name' is needed")
    check_group(call.group, place)
    call_fields(call)


def check_group(group: str, place: str) -> None:
    """Check that the list of commands has a heading; ``place``: of what names it.

    Raises:
        DeclarationError: it has not.
    """
    if group not in GROUPS:
        hint = did_you_mean(str(group), list(GROUPS))
        raise DeclarationError(f"{place}: group = '{group}' is no heading{hint} (allowed: {', '.join(GROUPS)})")


def typed_fields(call: type[Call]) -> list[CallField]:
    """Return the fields of a declaration that the command line has."""
    return [f for f in call_fields(call) if not f.option.python_only]


@dataclass(frozen=True)
class ServedField:
    """A field that requests have, and its option."""

    field: CallField
    option: Option

    @property
    def name(self) -> str:
        """Name of the field in requests."""
        return self.option.request_name or self.field.name

    @property
    def maximum(self) -> float | None:
        """The largest number that a request may give."""
        return self.option.max if self.option.max_served is None else self.option.max_served

    @property
    def label(self) -> str:
        """What it is called in a form."""
        return self.name.replace("_", " ").capitalize()

    @property
    def is_list(self) -> bool:
        """Whether it may be given several times; a list that is typed as one text is not."""
        return self.field.default == () and self.option.typed is not str

    @property
    def is_switch(self) -> bool:
        """Whether it is on or off."""
        return self.field.kind is bool

    @property
    def is_real(self) -> bool:
        """Whether it is a number with decimals."""
        return float in (self.field.kind, *get_args(self.field.kind))

    @property
    def is_number(self) -> bool:
        """Whether it is a number."""
        return self.is_real or (int in (self.field.kind, *get_args(self.field.kind)) and self.option.typed is not str)

    @property
    def is_typed(self) -> bool:
        """Whether a person can type it: it names no file and no job, and is no list."""
        return not (self.option.is_word or self.option.from_service or self.is_list)


def served_fields(call: type[Call]) -> list[ServedField]:
    """Return the fields of a declaration that requests have."""
    return [ServedField(f, f.option) for f in typed_fields(call) if f.option.is_served]


def _check_bounds(function: str, known: Sequence[CallField], asked: object) -> None:
    for field in known:
        value = getattr(asked, field.name)
        if fault := _beyond_bounds(field.option, value):
            raise InputError(f"{function}(): {field.name} = {value}, but {fault}")


def _beyond_bounds(option: Option, value: object) -> str:
    if not isinstance(value, int | float):
        return ""
    if not (option.min is None or option.min <= value):
        return f"the least is {option.min:g}"
    return "" if option.max is None or value <= option.max else f"the largest is {option.max:g}"


P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=Call)


def called_with(declaration: Callable[P, C]) -> Callable[[Callable[[C], R]], Callable[P, R]]:
    """Return a decorator that lets a function of a declaration's object be called with the fields of it.

    A type checker takes the signature from the declaration (PEP 612); ``inspect`` and ``help`` find it, and the
    arguments in the docstring.
    """
    call: type[Call] = declaration  # type: ignore[assignment]
    known = call_fields(call)
    fields_by_name = {f.name for f in known}
    parameters = [
        Parameter(
            f.name,
            Parameter.KEYWORD_ONLY if f.keyword else Parameter.POSITIONAL_OR_KEYWORD,
            default=Parameter.empty if f.is_required else f.default,
            annotation=getattr(f.kind, "__forward_arg__", f.kind),
        )
        for f in known
    ]

    def decorate(function: Callable[[C], R]) -> Callable[P, R]:
        """Return the function with the declaration's signature and docstring."""
        signature = Signature(parameters, return_annotation=function.__annotations__["return"])

        @wraps(function)
        def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
            """Call the function with the declaration's object; a notebook shows its progress."""
            try:
                _ = signature.bind(*args, **kwargs)
            except TypeError as err:
                raise TypeError(f"{function.__name__}(): {err}") from None
            asked = declaration(*args, **kwargs)
            _check_bounds(function.__name__, known, asked)
            if "progress" not in fields_by_name or "progress" in kwargs or not runs_in_notebook():
                return function(asked)
            with shown_progress(None) as shown:
                kwargs["progress"] = shown
                return function(declaration(*args, **kwargs))

        del wrapper.__wrapped__  # what is called is the signature, not the object behind it
        wrapper.__signature__ = signature  # type: ignore[attr-defined]
        wrapper.__doc__ = _with_arguments(cleandoc(function.__doc__ or ""), known)
        return wrapper

    return decorate


def _with_arguments(text: str, known: Sequence[CallField]) -> str:
    """Return a docstring with the section of the arguments before that of the errors."""
    lines = ["Args:", *(f"    {f.name}: {f.option.help}." for f in known)]
    head, raises, rest = text.partition("Raises:")
    return f"{head.rstrip()}\n\n" + "\n".join(lines) + (f"\n\n{raises}{rest}" if raises else "\n")


def options_table(call: type[Call]) -> str:
    """Return the options of a verb as a table of Markdown: names, values and what they do."""
    rows = [_table_row(f) for f in typed_fields(call)]
    head = ["| option | values | |", "|---|---|---|"]
    return "\n".join([*head, *(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows)])


def _table_row(field: CallField) -> tuple[str, ...]:
    option = field.option
    shown = option.metavar or field.name.upper()
    typed = shown if option.is_word else field.flag
    others = {"in Python": field.name, "over HTTP": option.request_name or field.name}
    usual = typed.removeprefix("--").replace("-", "_")
    other = [f"{where} `{name}`" for where, name in others.items() if name != usual and not option.is_word]
    return f"`{typed}`", ", ".join(_values(field)), option.help + (f" ({', '.join(other)})" if other else "")


def _values(field: CallField) -> Iterator[str]:
    """Yield what a field may be, and what it is where nobody says it."""
    option = field.option
    if field.values:
        yield ", ".join(f"`{v}`" for v in field.values)
    elif option.min is not None:
        yield f"{option.min:g} to {option.max:g}" if option.max is not None else f"from {option.min:g}"
    elif option.metavar and not option.is_word:
        yield f"`{option.metavar}`"
    if field.default not in (MISSING, None, "", False, ()):
        yield f"default {field.default}"


def find_function(call: type[Call]) -> Callable[..., Any]:
    """Return the function that does what is declared, with the libraries that it needs."""
    from importlib import import_module

    module, name = call.function.split(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function
