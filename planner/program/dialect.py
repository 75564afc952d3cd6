"""A controller's dialect as data: ``g-code/<name>/dialect.toml`` beside its ``program.j2``."""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from planner.errors import InputError, nearest
from planner.resources import folder
from planner.schema import Strict, read_toml

BlendKind = Literal["none", "mm", "percent", "path_degrees", "dense"]
SpeedKind = Literal["axis_percent", "tool_speed", "inverse_time"]


def _file_name(text: str) -> str:
    if text.replace("{name}", "").strip(".").isalnum() and text.count("{name}") == 1:
        return text
    raise ValueError("a file is called {name} and an extension")


def _pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as err:
        raise ValueError(f"is no regular expression: {err}") from err
    return text


FileName = Annotated[str, AfterValidator(_file_name)]
Pattern = Annotated[str, AfterValidator(_pattern)]


class Files(Strict):
    """Names of the files, ``{name}`` being the program's own, or the part's."""

    main: FileName
    part: FileName | None = None
    data: FileName | None = None


class Name(Strict):
    """What the controller takes as the name of a program: how many letters lead, what is a word of its own."""

    max_length: int = Field(gt=8)
    upper: bool = False
    letters: int = Field(default=1, ge=1, le=2)
    reserved: tuple[str, ...] = ()


class Comment(Strict):
    """How a remark begins and ends, and which characters may not stand in it."""

    start: str = Field(min_length=1)
    end: str = ""
    forbid: str = ""
    max_length: int = Field(default=72, gt=8)


class Blend(Strict):
    """How a corner is cut; ``percent`` is of half the leg, ``path_degrees`` of joint path."""

    kind: BlendKind
    word: str = ""
    exact: str = ""
    decimals: int = Field(default=0, ge=0, le=4)
    dense_deg: float = Field(default=1.0, gt=0)
    tolerance: str = ""


class Speed(Strict):
    """How a leg's speed is said. ``overrides``: coarse percentages, set at stops, that scale ``percent``."""

    kind: SpeedKind
    word: str = ""
    unit: Literal["%", "mm/s", "mm/min", "1/min"]
    decimals: int = Field(ge=0, le=4)
    overrides: tuple[int, ...] = (100,)
    approach: str = ""


class Dwell(Strict):
    """The word of a pause in time and the unit of its number."""

    word: str
    unit: Literal["s", "ms"]
    decimals: int = Field(default=3, ge=0, le=4)


class Sync(Strict):
    """The output pulse at a pose: lines for standing still, and for passing by; ``header`` makes the output ready.

    ``flying`` says where the passing mark stands: with the move that ends at the pose, or after it,
    in which case ``flying_off`` ends the pulse one move later. None of it is written, and no output is
    touched, where the cell names no output. ``passing`` says where on the path the mark in passing comes,
    if that is not the pose itself.
    """

    header: tuple[str, ...] = ()
    rest: tuple[str, ...]
    flying: Literal["with_move", "after"] = "after"
    flying_on: tuple[str, ...] = ()
    flying_off: tuple[str, ...] = ()
    note: str = ""
    passing: str = ""


class Select(Strict):
    """How the numbers of tool, base and load are said; an empty pattern: the program does not select it.

    ``note`` says what the speeds are of; ``{map}`` in it is the place of the measured point in the flange frame.
    """

    tool: str = ""
    base: str = ""
    load: str = ""
    note: str = ""


class Log(Strict):
    """How the controller's own record of its axes is read later: separated columns, or a pattern a line.

    ``passing``: it is kept in passing too; else only at rest, and a continuous session needs ``trace``.
    """

    file: str
    passing: bool = False
    columns: Literal["q", "cmd"] = "q"
    separator: str = ";"
    decimal: str = "."
    encoding: str = "ascii"
    row: str | None = None
    axis: str = ""
    note: str


class Centring(Strict):
    """The call of the routine that centres the head on ``{ball}`` at pose ``{pose}``; ``note``: where it comes from."""

    call: str
    note: str


class Reading(Strict):
    """What the independent reader looks for; it knows nothing of the template.

    ``family`` names a file of ``planner.program.reading``; the rest are regular expressions that the
    G-code family needs, as its words differ from machine to machine. ``pulse_end`` ends a pulse, so
    that a dwell inside it is not taken for one of the program's.
    """

    family: Literal["gcode", "krl", "rapid", "pdl2"]
    motion: Pattern = ""
    dwell: Pattern = ""
    sync: Pattern = ""
    pulse_end: Pattern = ""
    exact: Pattern = ""
    blended: Pattern = ""
    centre: Pattern = ""


class Option(Strict):
    """A variant of the dialect, asked for as ``name+option``; only the tables given here differ."""

    title: str
    blend: Blend


class Dialect(Strict):
    """All that is said of a dialect in its ``dialect.toml``."""

    schema_: Literal["edbb-dialect/1"] = Field(alias="schema")
    title: str
    files: Files
    name: Name
    units: str
    axes: tuple[str, ...] = Field(min_length=1)
    min_joints: int = Field(default=1, ge=1)
    decimals: int = Field(ge=1, le=6)
    encoding: Literal["ascii", "utf-8", "latin-1"] = "ascii"
    line_ending: Literal["lf", "crlf"] = "lf"
    max_line: int = Field(ge=40)
    part_lines: int | None = Field(default=None, ge=20)
    number_step: int = Field(default=0, ge=0)
    output: str = "{number}"
    input: str = "{number}"
    trace: str = Field(min_length=1)
    header: tuple[str, ...] = ()
    footer: tuple[str, ...] = ()
    pause: tuple[str, ...]
    wait: tuple[str, ...]
    wait_note: str = ""
    comment: Comment
    blend: Blend
    speed: Speed
    dwell: Dwell
    sync: Sync
    select: Select = Select()
    log: Log | None = None
    centre: Centring | None = None
    reading: Reading
    options: dict[str, Option] = {}

    @property
    def max_joints(self) -> int:
        """Return how many axes the dialect has words for."""
        return len(self.axes)

    def signal(self, text: str, output: int | None, gauge_input: int | None) -> str:
        """Return ``text`` with the names of the cell's output and input in it, as far as the cell has them."""
        for word, pattern, number in (("{output}", self.output, output), ("{input}", self.input, gauge_input)):
            if number is not None:
                text = text.replace(word, pattern.replace("{number}", str(number)))
        return text


def root() -> Path:
    """Return the folder that holds one folder a dialect."""
    return folder("g-code")


def names() -> list[str]:
    """Return the names of the dialects on disk, in alphabetical order."""
    return sorted(p.parent.name for p in root().glob("*/dialect.toml"))


def load(name: str) -> Dialect:
    """Read dialect ``name``, or ``name+option`` for a variant that its file offers.

    Raises:
        InputError: no such dialect or option, or its file has an unknown, missing or wrong key.
    """
    base, _, option = name.partition("+")
    known = names()
    if base not in known:
        raise InputError(f"no dialect '{name}'{nearest(base, known)} (known: {', '.join(known)})")
    dialect = read_toml(root() / base / "dialect.toml", Dialect)
    if not option:
        return dialect
    if option not in dialect.options:
        offered = ", ".join(f"{base}+{o}" for o in dialect.options) or "no options"
        raise InputError(f"dialect '{base}' has no option '{option}' (it offers: {offered})")
    return dialect.model_copy(update={"blend": dialect.options[option].blend})
