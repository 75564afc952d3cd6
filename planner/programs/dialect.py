"""A controller's dialect as data: a folder ``g-code/<name>`` with two files; Python only for a language that is new.

``dialect.toml``
    What the controller takes: ``language``, as lists call it and its like; names and number of its axes (``angles``:
    whether they are the ``controller``'s, which the robot's file describes, or the ``model``'s; ``pulses``: whether
    programs count the axes in pulses, of which the robot's file says how many are a degree; ``slides_from``: the first
    that may be one that slides, as external axes are), decimals, line ends and limits (``part_lines`` of a
    file, ``max_lines`` where a program has no parts, ``block_ms`` to prepare a block), comment, blending (``none``,
    ``mm``, ``percent`` of half the leg, ``path_degrees``, or ``dense``: only small steps run on), the kind and word
    of its speed (``axis_percent``, ``tool_speed``, ``inverse_time``, ``leading_axis`` that turns furthest,
    ``duration`` of the leg), the circle of the tool where the language has one (``[circle]``), dwell, the pulse at
    a pose standing still and in passing, ``pause`` (the lines by which the program stops for a person, ``{what}`` being
    the text for the pendant; ``go_on``: what lets it go on), ``wait`` (for an input), the log of its own axes,
    what an abort leaves changed (``abort``), the words that select tool, base and load, the call of a centring routine
    under ``[centre]``, and under ``[reading]`` the family of the reader. Every key is checked; a wrong one is named.
``program.j2``
    A Jinja2 template with a macro ``step(s)``, which prints one step (``s.kind`` is one of move, dwell,
    sync, sync_on, sync_off, log, log_passing, unlogged, centre, pause, wait, comment, section, reduction; the branches
    of ``[resume]`` are printed as it says; ``usual(s)`` of ``common.j2`` prints what needs no words of its own), and a
    macro ``main(parts)``, which prints the file around the parts' lines; ``part(part)`` and
    ``data(parts)`` where ``[files]`` names such files. ``d`` is the dialect, ``p`` the program, ``name``
    its name, ``rows`` the steps that log, ``passing`` those of them that log while the robot moves,
    ``remarks`` what the head of the program tells the operator. An undefined name is an error.

To add one: copy the nearest folder, change both files, run ``tests/programs``, which takes every folder that is there.
``docs/extend/dialect.md`` says what a new language needs.
"""

import re
import string
import textwrap
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr

from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder
from planner.common.schema import StrictModel, read_toml_again
from planner.common.units import Array
from planner.programs.motion_styles import BlendStyle, CircleStyle, OverrideStyle, Pattern, SpeedStyle


def _file_name(text: str) -> str:
    if re.fullmatch(r"\{name\}\w*\.\w+", text, re.ASCII):
        return text
    raise ValueError("a file is called {name} and an extension")


FileName = Annotated[str, AfterValidator(_file_name)]


class FileNaming(StrictModel):
    """Names of the files, ``{name}`` being the program's own, or the part's.

    ``cut``: a language that cannot wait for the operator has a file for each stretch between two pauses.
    ``together``: which files of the language are one program that is corrected as a whole: those of one ``stem``, or
    all in one ``folder``.
    """

    main: FileName
    cut: Literal["", "pause"] = ""
    part: FileName | None = None
    data: FileName | None = None
    together: Literal["", "stem", "folder"] = ""


class NameRule(StrictModel):
    """What the controller takes as the name of a program: how many letters lead, what is a word of its own."""

    max_length: int = Field(gt=8)
    upper: bool = False
    letters: int = Field(default=1, ge=1, le=2)
    reserved: tuple[str, ...] = ()


class CommentStyle(StrictModel):
    """How a remark begins and ends, which characters may not stand in it, and how long a text may be.

    A character ``apart`` may not stand twice in a row. ``width`` of a line is less where the controller takes short
    remarks: a longer text is several of them.
    """

    start: str = Field(min_length=1)
    end: str = ""
    forbid: str = ""
    apart: str = ""
    max_length: int = Field(default=72, gt=8)
    width: int = Field(default=1000, gt=8)

    def wrap(self, text: str) -> list[str]:
        """Return the lines of a text, each short enough for a remark of its own."""
        return textwrap.wrap(text, min(self.width, self.max_length)) or [text]


INSTEAD = {"(": ", ", ")": ", ", ";": ",", '"': "'"}  # in a comment, for what may not stand there


def comment_text(text: str, style: CommentStyle) -> str:
    """Return ``text`` on one line, in ASCII, with commas for characters that would end a comment, cut to its length.

    Commas of the text itself stay where it ends, too: it may be a line of a longer one.
    """
    return plain_text(text, style)[: style.max_length].rstrip()


def plain_text(text: str, style: CommentStyle) -> str:
    """Return ``text`` as :func:`comment_text` does, as long as it is."""
    ascii_text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    instead = {c: " " if set(INSTEAD.get(c, " ")) & set(style.forbid) else INSTEAD.get(c, " ") for c in style.forbid}
    gaps = [c for c, new in instead.items() if not new.strip(", ")]
    inner = ascii_text.strip("".join(gaps) + string.whitespace)  # no comma stands for what begins or ends the text
    kept = "".join(instead.get(c, c if c.isprintable() else " ") for c in inner)
    for c in style.apart:
        kept = re.sub(rf"{re.escape(c)}(?={re.escape(c)})", f"{c} ", kept)
    return " ".join(re.sub(r"\s*,(\s*,)*(?=\s|$)", ",", kept).split())


def fill_words(pattern: str, words: Mapping[str, object]) -> str:
    """Return ``pattern`` with its words in braces replaced, all at once: what is put in is no pattern itself."""
    return re.sub(r"\{(\w+)\}", lambda found: str(words.get(found[1], found[0])), pattern)


class DwellStyle(StrictModel):
    """The word of a pause in time and the unit of its number."""

    word: str
    unit: Literal["s", "ms"]
    decimals: int = Field(default=3, ge=0, le=4)


class SyncStyle(StrictModel):
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


class SelectStyle(StrictModel):
    """How the numbers of tool, base and load are said; an empty pattern: the program does not select it.

    ``note`` says what the speeds are of; ``{map}`` in it is the place of the measured point in the flange frame.
    """

    tool: str = ""
    base: str = ""
    load: str = ""
    note: str = ""


class LogStyle(StrictModel):
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


class ResumeStyle(StrictModel):
    """How a session is started at a later pose: a variable that the operator sets, and branches on it.

    ``{until}`` and ``{at}`` are the number that is compared, ``{ID}`` and ``{id}`` the plan's id in capitals or not,
    ``{number}`` one of its own for each branch. ``counted``: how the number of poses logged in passing is set.
    """

    variable: str
    stretch: str
    entry: str
    end: str
    counted: str = ""
    how: str


class CentringCall(StrictModel):
    """The call of the routine that centres the head on ``{ball}`` at pose ``{pose}``; ``note``: where it comes from."""

    call: str
    note: str


class ReaderWords(StrictModel):
    """What the readers look for; they know nothing of the template.

    ``family`` names a reader of :mod:`planner.programs.languages`. By ``content`` a file is known whose suffix no
    dialect has, and ``suffixes`` are further ones. Of a program of others, lines that match ``before_head`` stay
    above the remark about its correction, none below one that matches its group ``last``; ``remark`` is how such a
    remark is written where it is not as in the dialect's own programs. The rest are regular expressions
    that the G-code family needs, as its words differ from machine to machine. ``pulse_end`` ends a pulse, so that a
    dwell inside it is not taken for one of the program's; ``with_motion``: G words that may stand beside a move.
    ``passive`` is, for every family, the whole list of what a program may hold beside moves, speeds, dwells and the
    lines of this file (header, footer, pause, wait, sync, select): a program with anything else is not released.
    ``{output}`` and ``{input}`` in it are the cell's own; remarks and quoted text are blank when it is compared.
    """

    family: str
    content: Pattern = ""
    suffixes: tuple[str, ...] = ()
    before_head: Pattern = "(?!)"
    remark: CommentStyle | None = None
    motion: Pattern = ""
    dwell: Pattern = ""
    sync: Pattern = ""
    pulse_end: Pattern = ""
    exact: Pattern = ""
    blended: Pattern = ""
    centre: Pattern = ""
    with_motion: Pattern = "G9[34]|G53"
    passive: tuple[Pattern, ...] = ()


@dataclass(frozen=True)
class PathForm:
    """How a controller wants a path that is measured while moving.

    Attributes:
        dense: in small steps, every corner already cut.
        circles: circles of the tool as such, where they are.
        block_s: time that the controller takes to prepare a block [s]: no small step is shorter.
    """

    dense: bool = False
    circles: bool = False
    block_s: float = 0.02


class DialectOption(StrictModel):
    """A variant of the dialect, asked for as ``name+option``; only the tables given here differ."""

    title: str
    blend: BlendStyle


class Dialect(StrictModel):
    """All that is said of a dialect in its ``dialect.toml``."""

    schema_: Literal["edbb-dialect/1"] = Field(alias="schema")
    title: str
    language: str = Field(min_length=1)
    files: FileNaming
    name_rule: NameRule = Field(alias="name")
    units: str
    axes: tuple[str, ...] = Field(min_length=1)
    angles: Literal["controller", "model"] = "controller"
    min_joints: int = Field(default=1, ge=1)
    slides_from: int | None = Field(default=None, ge=1)
    decimals: int = Field(ge=0, le=6)
    pulses: bool = False
    encoding: Literal["ascii", "utf-8", "latin-1"] = "ascii"
    line_ending: Literal["lf", "crlf"] = "lf"
    max_line: int = Field(ge=40)
    part_lines: int | None = Field(default=None, ge=20)
    max_lines: int | None = Field(default=None, ge=20)
    block_ms: float = Field(gt=0, le=1000)
    number_step: int = Field(default=0, ge=0)
    output: str = "{number}"
    input: str = "{number}"
    trace: str = Field(min_length=1)
    abort: str = Field(min_length=1)
    header: tuple[str, ...] = ()
    footer: tuple[str, ...] = ()
    pause: tuple[str, ...]
    go_on: str = "press Start"
    wait: tuple[str, ...]
    wait_note: str = ""
    comment: CommentStyle
    blend: BlendStyle
    circle: CircleStyle | None = None
    speed: SpeedStyle
    override: OverrideStyle
    dwell: DwellStyle
    sync: SyncStyle
    select: SelectStyle = SelectStyle()
    log: LogStyle | None = None
    centre: CentringCall | None = None
    resume: ResumeStyle | None = None
    reading: ReaderWords
    options: dict[str, DialectOption] = {}
    _name: str = PrivateAttr("")

    @property
    def name(self) -> str:
        """Return the name by which the dialect is chosen: its folder, and ``+option`` where one was chosen."""
        return self._name

    @property
    def folder(self) -> Path:
        """Return the folder of its two files."""
        return dialect_root() / self._name.partition("+")[0]

    @property
    def max_joints(self) -> int:
        """Return how many axes the dialect has words for."""
        return len(self.axes)

    @property
    def extensions(self) -> tuple[str, ...]:
        """Return the extensions of the dialect's files, with the dot."""
        return tuple(Path(name).suffix for name in (self.files.main, self.files.data) if name is not None)

    def resolution_deg(self, pulses_per_deg: Sequence[float] = ()) -> Array:
        """Return half of the last printed digit of each axis [deg], or of all; ``pulses_per_deg``: of the robot's."""
        per_deg = np.array(pulses_per_deg) if self.pulses else np.ones(1)
        return np.asarray(0.5 * 10.0**-self.decimals / per_deg)

    @property
    def wants_dense_path(self) -> bool:
        """Return whether a blended path must be given in small steps to be driven without stops."""
        return self.blend.kind == "dense"

    @property
    def path_form(self) -> PathForm:
        """Return how the controller wants a path that is measured while moving."""
        return PathForm(self.wants_dense_path, self.circle is not None, self.block_ms / 1e3)

    @property
    def logs_axes(self) -> bool:
        """Return whether the program records the axes at rest."""
        return self.log is not None

    @property
    def logs_passing(self) -> bool:
        """Return whether it does so in passing too; else a continuous session needs ``trace``."""
        return self.log is not None and self.log.passing

    @property
    def logging(self) -> str:
        """Return where the program logs the axes, and with what they are recorded elsewhere."""
        if self.logs_passing:
            return "at rest and in passing"
        return f"at rest; in passing: {self.trace}" if self.logs_axes else f"no: {self.trace}"

    def fill(self, pattern: str, output: int | None, gauge_input: int | None, **words: object) -> str:
        """Return a line of the dialect's file with ``words`` in it, and the cell's output and input where it has them.

        All are put in at once, so that braces in a person's words stay what they are.
        """
        signals = (("output", self.output, output), ("input", self.input, gauge_input))
        named = {word: fill_words(name, {"number": n}) for word, name, n in signals if n is not None}
        return fill_words(pattern, named | words)


def dialect_root() -> Path:
    """Return the folder that holds one folder a dialect."""
    return data_folder("g-code")


def dialect_names() -> list[str]:
    """Return the names of the dialects on disk, in alphabetical order."""
    return sorted(p.parent.name for p in dialect_root().glob("*/dialect.toml"))


def load_dialect(name: str, known: list[str] | None = None) -> Dialect:
    """Read dialect ``name``, or ``name+option`` for a variant that its file offers; ``known``: those on disk.

    Raises:
        InputError: no such dialect or option, or its file has an unknown, missing or wrong key.
    """
    base, _, option = name.partition("+")
    if base not in (known := known or dialect_names()):
        raise InputError(f"no dialect '{name}'{did_you_mean(base, known)} (known: {', '.join(known)})")
    dialect = read_toml_again(dialect_root() / base / "dialect.toml", Dialect)
    if option and option not in dialect.options:
        offered = ", ".join(f"{base}+{o}" for o in dialect.options) or "no options"
        raise InputError(f"dialect '{base}' has no option '{option}' (it offers: {offered})")
    dialect = dialect.model_copy(update={"blend": dialect.options[option].blend} if option else {})
    dialect._name = name
    return dialect


def dialects() -> tuple[Dialect, ...]:
    """Return every dialect on disk, in alphabetical order."""
    names = dialect_names()
    return tuple(load_dialect(name, names) for name in names)
