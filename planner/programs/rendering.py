"""Puts the steps and the remarks for the operator through a dialect's template and cuts the result into files."""

import re
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, pass_context
from jinja2.environment import TemplateModule
from jinja2.runtime import Context

from planner.common.errors import InputError
from planner.common.file_names import name_fault
from planner.kinematics.axes import MODEL
from planner.programs.dialect import Dialect, comment_text, dialect_root, fill_words, plain_text
from planner.programs.instructions import Centre, Program, Sync, WaitInput
from planner.programs.motion_words import format_fixed_point
from planner.programs.steps import ProgramStep, lower_program

NUMBERS = ("tool", "base", "load")


START_NOTE = (
    "to start at pose N: {how}, N from 1 to {last} as counted in this program; the way from the mount pose to it is "
    "planned, what comes before is left out; what was measured is kept, and a gauge that is zeroed is zeroed anew"
)


def operator_cautions(program: Program, dialect: Dialect, steps: tuple[ProgramStep, ...]) -> tuple[str, ...]:
    """Return warnings of what the program does not do by itself, or does elsewhere than expected; one sentence each."""
    control = program.controller
    found = [program.changed] if program.changed else []
    if control.sync_output is None and any(isinstance(i, Sync) for i in program.instructions):
        found.append("no output marks the poses and none is touched, the cell names no controller.sync_output")
    if control.sync_output is not None and not dialect.sync.rest:
        found.append("this format switches no output: where the arm comes to rest tells the poses")
    if control.gauge_input is None and any(isinstance(i, WaitInput) for i in program.instructions):
        found.append(
            "at the start the operator says that the gauge is ready, no input does: the cell names no "
            "controller.gauge_input"
        )
    numbers = ((name, getattr(control, name)) for name in NUMBERS if not getattr(dialect.select, name))
    by_hand = [f"{name} {number}" for name, number in numbers if number is not None]
    if by_hand:
        found.append(f"select {', '.join(by_hand)} by hand before the start, the program does not")
    if any(s.kind == "unlogged" for s in steps):
        found.append(
            "this program does not log the axis angles in passing. A continuous session needs the actual positions of "
            f"the axes: record them with {dialect.trace}, and edbb import reads them"
        )
    passing = any(s.kind in ("sync_on", "log_passing") or (s.move is not None and s.move.pulse) for s in steps)
    if dialect.sync.passing and passing:
        found.append(dialect.sync.passing)
    return tuple(found)


def explanations(program: Program, dialect: Dialect) -> tuple[str, ...]:
    """Return the meanings of the program's signals and selections, and what they need on the controller."""
    notes = [
        axes_note(program, dialect),
        dialect.sync.note if program.controller.sync_output is not None else "",
        dialect.wait_note if program.controller.gauge_input is not None else "",
        dialect.select.note,
        dialect.speed.note,
        dialect.override.sentence,
        dialect.abort,
        _cycle_note(program, dialect),
        dialect.centre.note if dialect.centre and any(isinstance(i, Centre) for i in program.instructions) else "",
    ]
    if dialect.resume is not None and program.entries:
        last = max(until for until, _ in program.stretches)
        words = {"last": last, "ID": program.plan_id.upper(), "id": program.plan_id}
        notes.append(fill_words(fill_words(START_NOTE, {"how": dialect.resume.how}), words))
    elif dialect.resume is None:
        notes.append("this controller has no variable to start at a later pose: it starts at the first")
    place = "[" + ", ".join(format_fixed_point(v, 3) for v in program.map_mm) + "]"
    control = program.controller
    return tuple(dialect.fill(n, control.sync_output, control.gauge_input, map=place) for n in notes if n)


def axis_names(dialect: Dialect) -> tuple[str, ...]:
    """Return the common names of the axes: ``A1`` for the word ``A1=``, ``J1`` where the language counts them."""
    names = (word.rstrip("=") for word in dialect.axes)
    return tuple(f"J{name}" if name.isdigit() else name for name in names)


def axes_note(program: Program, dialect: Dialect) -> str:
    """Say whose axes the angles of a program are, and how they follow from the joints of the plan."""
    axes, names = program.axes, axis_names(dialect)[: program.n_joints]
    if axes is None:
        return ""
    joints = f"q1 to q{program.n_joints}"
    if axes.controller == MODEL:
        return f"axes: {joints} are the joints of the robot model; robot.toml says how a controller counts"
    if axes.is_same:
        return f"axes: {names[0]} to {names[-1]} count as {joints} of the plan ({axes.source})"
    return f"axes: {', '.join(axes.sentences(names))}, by {joints} of the plan ({axes.source})"


def _cycle_note(program: Program, dialect: Dialect) -> str:
    """Say how quickly blocks follow one another, where there are many or some are quicker than the controller."""
    times = sorted(1e3 * m.duration_s for m in program.moves if m.blend_mm > 0.0)
    block_ms = program.controller.block_ms or dialect.block_ms
    short = bisect_left(times, block_ms * (1.0 - 1e-9))
    if len(times) < 500 and not short:  # blocks without a stop, beyond which the time of the shortest is said
        return ""
    said = (
        f"{len(times)} blocks without a stop, the shortest takes {times[0]:.0f} ms, half of them under "
        f"{times[len(times) // 2]:.0f} ms: a block must be prepared in less, {block_ms:g} ms are reckoned with"
    )
    return f"{said}; it brakes at {short} quicker ones, lower the measuring speed" if short else said


LINE_END = {"lf": "\n", "crlf": "\r\n"}


@dataclass(frozen=True)
class ProgramFile:
    """A file for the controller: ``text`` holds its own line ends, ``encoding`` its characters."""

    name: str
    text: str
    encoding: str = "ascii"


def _check_length(dialect: Dialect, lines: int, limit: int | None) -> None:
    """Refuse a file that is longer than cell or controller allow, of a language whose programs have no parts."""
    limit, who = (limit, "controller.part_lines") if limit is not None else (dialect.max_lines, "the controller")
    if limit is not None and lines > limit:
        raise InputError(
            f"the program has {lines} lines, {who} allows {limit}, and a program of {dialect.title} "
            "has no parts: take another dialect, or fewer poses"
        )


@dataclass(frozen=True)
class ProgramPart:
    """A stretch of a long program that the main program calls by ``name``."""

    name: str
    number: int
    lines: tuple[str, ...]


def program_name(stem: str, dialect: Dialect, room: int = 0) -> str:
    """Return ``stem`` as a name that the controller takes: letters, digits, underscores, not too long.

    ``room`` characters are left free for the number of a part.
    """
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_")
    led = len(name) >= dialect.name_rule.letters and name[: dialect.name_rule.letters].isalpha()
    if not led or name.lower() in dialect.name_rule.reserved or name_fault(name):
        name = f"PR_{name}"
    name = name[: dialect.name_rule.max_length - room].rstrip("_")
    return name.upper() if dialect.name_rule.upper else name


def render_program(program: Program, dialect: Dialect, stem: str) -> tuple[ProgramFile, ...]:
    """Return the files of ``program``; the first is the one to start.

    Raises:
        InputError: the dialect cannot carry the program, or its template is wrong.
    """
    program = program if dialect.resume else program.without_starts()
    steps = lower_program(program, dialect)
    try:
        return _render_files(program, dialect, stem, steps)
    except TemplateError as err:
        raise InputError(f"{dialect.folder / 'program.j2'}: {err}") from err


def _render_files(
    program: Program, dialect: Dialect, stem: str, steps: tuple[ProgramStep, ...]
) -> tuple[ProgramFile, ...]:
    template = _environment(dialect.folder, dialect_root()).get_template("program.j2")
    name = program_name(stem, dialect)
    context = {
        "d": dialect,
        "p": program,
        "name": name,
        "rows": [s for s in steps if s.kind in ("log", "log_passing")],
        "passing": [s for s in steps if s.kind == "log_passing"],
        "remarks": _remarks(program, dialect, steps),
        "resumed": bool(program.entries),
        "circles": program.has_circles,
        "moves": [s.move for s in steps if s.move is not None],
    }
    module = template.make_module(context)
    blocks = _step_lines(module, program, dialect, steps)
    limit = program.controller.part_lines or dialect.part_lines
    if limit is not None and sum(map(len, blocks)) > limit:
        name = program_name(stem, dialect, room=4)
        module = template.make_module({**context, "name": name})
        blocks = _step_lines(module, program, dialect, steps)
    if dialect.files.cut == "pause":
        cut = [ProgramPart(f"{name}_{i:03d}", i, lines) for i, lines in enumerate(_cut_at_pauses(blocks, steps), 1)]
        _check_length(dialect, max(len(p.lines) for p in cut), limit)
        parts_of = [(dialect.files.main.format(name=p.name), _lines(module, "main", p)) for p in cut]
        return tuple(_finish(file_name, lines, dialect) for file_name, lines in parts_of)
    parts = _split(blocks, name, limit)
    files = [(dialect.files.main.format(name=name), _lines(module, "main", parts))]
    if dialect.part_lines is None:
        _check_length(dialect, sum(map(len, blocks)), limit)
    if dialect.files.part is not None and len(parts) > 1:
        files += [(dialect.files.part.format(name=p.name), _lines(module, "part", p)) for p in parts]
    if dialect.files.data is not None:
        files.append((dialect.files.data.format(name=name), _lines(module, "data", parts)))
    return tuple(_finish(file_name, lines, dialect) for file_name, lines in files)


@lru_cache  # compiling the templates takes longer than a short program; a file that was changed is read again
def _environment(folder: Path, root: Path) -> Environment:
    environment = Environment(
        loader=FileSystemLoader([folder, root]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,  # a robot program is no HTML
    )
    environment.filters |= {"fixed": format_fixed_point, "comment_text": _comment}
    return environment


@pass_context
def _comment(context: Context, text: str) -> str:
    return comment_text(text, context["d"].comment)


def _remarks(program: Program, dialect: Dialect, steps: tuple[ProgramStep, ...]) -> list[str]:
    """Return what the head of the program says, in lines that fit into comments."""
    said = (*program.cautions, *operator_cautions(program, dialect, steps), *explanations(program, dialect))
    return [line for text in said for line in dialect.comment.wrap(plain_text(text, dialect.comment))]


def _lines(module: TemplateModule, macro: str, *values: object) -> list[str]:
    if not hasattr(module, macro):
        raise TemplateError(f"the macro '{macro}' is missing")
    text = str(getattr(module, macro)(*values))
    return [line.rstrip() for line in text.split("\n") if line.strip()]


def _step_lines(
    module: TemplateModule, program: Program, dialect: Dialect, steps: tuple[ProgramStep, ...]
) -> list[list[str]]:
    """Return the lines of the steps; a branch is one block, so that no file ends inside it."""
    blocks: list[list[str]] = []
    inside = False
    for step in steps:
        branch = step.kind in ("stretch", "entry", "end")
        lines = _branch_lines(program, dialect, steps, step) if branch else _lines(module, "step", step)
        if inside:
            blocks[-1] += lines
        else:
            blocks.append(lines)
        inside = step.kind != "end" if branch else inside
    return blocks


def _branch_lines(program: Program, dialect: Dialect, steps: tuple[ProgramStep, ...], step: ProgramStep) -> list[str]:
    style = dialect.resume
    assert style is not None
    words: dict[str, object] = {"until": step.until, "at": step.until, "number": step.number, "rows": step.row}
    words |= {"ID": program.plan_id.upper(), "id": program.plan_id}
    text = {"stretch": style.stretch, "entry": style.entry}.get(step.kind, style.end)
    counted = step.kind == "entry" and any(s.kind == "log_passing" for s in steps)
    lines = [text, style.counted] if counted and style.counted else [text]
    return [fill_words(line, words) for line in lines]


def _split(blocks: list[list[str]], name: str, limit: int | None) -> list[ProgramPart]:
    """Cut between steps, never inside one, into parts of at most ``limit`` lines."""
    cut: list[list[str]] = [[]]
    for lines in blocks:
        if limit is not None and cut[-1] and len(cut[-1]) + len(lines) > limit:
            cut.append([])
        cut[-1].extend(lines)
    return [ProgramPart(f"{name}_{i:03d}", i, tuple(lines)) for i, lines in enumerate(cut, start=1)]


def _cut_at_pauses(blocks: list[list[str]], steps: tuple[ProgramStep, ...]) -> list[tuple[str, ...]]:
    """Return the lines of each stretch that moves; what stands before it tells what the operator does first."""
    cut: list[list[str]] = [[]]
    moved = False
    for step, lines in zip(steps, blocks, strict=True):
        if step.kind == "pause" and moved:
            cut.append([])
            moved = False
        cut[-1] += lines
        moved = moved or step.kind == "move"
    if not moved and len(cut) > 1:
        cut[-2:] = [cut[-2] + cut[-1]]
    return [tuple(lines) for lines in cut]


def _finish(name: str, lines: list[str], dialect: Dialect) -> ProgramFile:
    if dialect.number_step:
        code = [not line.startswith((dialect.comment.start, "%")) for line in lines]
        numbers = (n * dialect.number_step for n in accumulate(code))
        lines = [f"N{n} {x}" if c else x for x, c, n in zip(lines, code, numbers, strict=True)]
    for number, line in enumerate(lines, start=1):
        if len(line) > dialect.max_line:
            raise InputError(f"{name}, line {number}: {len(line)} characters, {dialect.title} takes {dialect.max_line}")
    end = LINE_END[dialect.line_ending]
    return ProgramFile(name, end.join(lines) + end, dialect.encoding)
