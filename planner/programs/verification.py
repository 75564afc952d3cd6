"""Programs are written in a dialect, read back, and compared with what was planned."""

import math
import re
from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules

import numpy as np

import planner.programs.languages as languages
from planner.common.errors import InputError, PlannerError, did_you_mean
from planner.common.units import Array
from planner.programs.dialect import Dialect, load_dialect
from planner.programs.instructions import Centre, Dwell, JointMove, Program, StopKind, Sync
from planner.programs.languages.execution import Execution, ReadBack, ReadMove
from planner.programs.motion_words import leading_speed
from planner.programs.rendering import ProgramFile, operator_cautions, render_program
from planner.programs.steps import lower_program

for _module in iter_modules(languages.__path__):
    import_module(f"{languages.__name__}.{_module.name}")
EXECUTIONS: Mapping[str, type[Execution]] = Execution.families
"""The reader of each family of languages, as ``[reading] family`` of a dialect names it."""


def reader_of(dialect: Dialect) -> type[Execution]:
    """Return the reader of a dialect's family.

    Raises:
        InputError: no such family.
    """
    family, known = dialect.reading.family, list(EXECUTIONS)
    if family not in known:
        raise InputError(
            f"dialect '{dialect.name}': reading.family = '{family}' has no reader{did_you_mean(family, known)} "
            f"(there are {', '.join(known)})"
        )
    return EXECUTIONS[family]


def read_texts(
    dialect: Dialect,
    texts: tuple[str, ...],
    program: Program | None = None,
    only_known: bool = True,
    pulses_per_deg: tuple[float, ...] = (),
) -> ReadBack:
    """Return the motion that the files ``texts`` make the robot do; the first file is the one that is started.

    Args:
        dialect: the dialect that they are written in.
        texts: of the files.
        program: what they were written for; only its own tool, base, load and signals are known then.
        only_known: refuse a statement that the reader does not know, instead of passing it over.
        pulses_per_deg: of each axis, for a language that counts in pulses, where there is no program.

    Raises:
        InputError: a line that is not of the language, no plan_id, or two different ones; a family without a reader.
    """
    execution = reader_of(dialect)(dialect, program)
    execution.pulses_per_deg = program.pulses_per_deg if program is not None else pulses_per_deg
    execution.run(texts)
    if only_known and execution.unknown:
        unknown = execution.unknown[0]
        raise InputError(f"line {unknown.line}: the reader does not know the statement '{unknown.text}'")
    return execution.result(_plan_id_of(texts))


def _plan_id_of(texts: tuple[str, ...]) -> str:
    """Return the plan_id that every one of the files names in a comment."""
    found: set[str] = {m for text in texts for m in re.findall(r'plan_id"?:\s*"?([0-9a-f]{12})\b', text)}
    unnamed = [n for n, text in enumerate(texts, start=1) if not re.search('plan_id"?:', text)]
    if len(found) != 1 or unnamed:
        raise InputError(f"every file must name the same plan_id, found {sorted(found) or 'none'}")
    return found.pop()


ROUNDING_RATIO = 1.0 + 1e-6  # of what is read to what is allowed: numbers are rounded


class ProgramMismatchError(PlannerError):
    """The text of a program does not do what was planned, so it must not be released."""


def check_program(program: Program, dialect: Dialect, texts: tuple[str, ...]) -> ReadBack:
    """Read ``texts`` back and hold them against ``program``.

    Raises:
        InputError: nobody reads the dialect's family.
        ProgramMismatchError: a joint angle off by more than the printed resolution; a move, dwell or pulse
            too many or too few; a statement that is not on the dialect's list; a corner rounded more, or a leg
            driven faster, than planned; another plan_id.
    """
    program = program if dialect.resume else program.without_starts()
    reader_of(dialect)
    try:
        found = read_texts(dialect, texts, program)
    except InputError as err:
        raise ProgramMismatchError(f"the program is not released, it cannot be read back: {err}") from err
    for complaint in _complaints(program, dialect, found):
        raise ProgramMismatchError(f"the program is not released: {complaint}")
    return found


def _complaints(program: Program, dialect: Dialect, found: ReadBack) -> Iterator[str]:
    if found.plan_id != program.plan_id:
        yield f"it belongs to plan {found.plan_id}, not {program.plan_id}"
    planned = np.array([m.q_deg for m in program.moves])
    if found.joint_path_deg.shape != planned.shape:
        (n, axes), (n_planned, axes_planned) = found.joint_path_deg.shape, planned.shape
        yield f"it has {n} moves of {axes} axes, planned are {n_planned} of {axes_planned}"
        return
    off = np.abs(found.joint_path_deg - planned)
    over = off / _resolution(program, dialect)
    if over.max() > 1.0:
        move, axis = np.unravel_index(int(over.argmax()), off.shape)
        yield f"move {move + 1} has axis {axis + 1} off by {off[move, axis]:.6f} {program.unit_of(int(axis))}"
    dwells = [i.seconds for i in program.instructions if isinstance(i, Dwell)]
    if len(dwells) != len(found.dwells_s) or not np.allclose(dwells, found.dwells_s, rtol=0.0, atol=1e-3):
        yield f"it dwells {len(found.dwells_s)} times, planned are {len(dwells)}, or the times differ"
    marked = sum(isinstance(i, Sync) for i in program.instructions)
    syncs = marked if program.controller.sync_output is not None and dialect.sync.rest else 0
    if syncs != found.syncs:
        yield f"it pulses {found.syncs} times, planned are {syncs}"
    if found.stops != (stops := _stops(program, dialect)):
        yield f"it waits for a person or an input {len(found.stops)} times, planned are {len(stops)}, or elsewhere"
    if found.centrings != _centrings(program):
        yield "it centres other balls, or elsewhere, than planned"
    yield from _other_circles(program, dialect, found)
    yield from _too_round(program, dialect, found)
    yield from _too_fast(dialect, program.home_deg, program.moves, found.moves, "move")
    yield from _too_abrupt(program, found)
    yield from _wrong_starts(program, dialect, found)


def _too_abrupt(program: Program, found: ReadBack) -> Iterator[str]:
    """Compare the accelerations that a stream of goals asks of the joints with their limits."""
    if not program.acceleration_deg_s2 or not found.acceleration_deg_s2:
        return
    for joint, (asked, limit) in enumerate(
        zip(found.acceleration_deg_s2, program.acceleration_deg_s2, strict=True), start=1
    ):
        if not asked <= limit * ROUNDING_RATIO:
            unit = program.unit_of(joint - 1)
            yield f"it accelerates joint {joint} at {asked:.0f} {unit}/s2, allowed are {limit:.0f} {unit}/s2"


def _stops(program: Program, dialect: Dialect) -> tuple[tuple[StopKind, int], ...]:
    """Return where a program of the dialect waits; one that has a file for each stretch waits between two of them."""
    if dialect.files.cut != "pause":
        return program.stops
    between = {stop: None for stop in program.stops if stop[0] == "pause" and 0 < stop[1] < len(program.moves)}
    return tuple(between)


def _centrings(program: Program) -> tuple[tuple[int, int, int], ...]:
    """After how many moves the routine is called, at which ball and pose."""
    out, moves = [], 0
    for item in program.instructions:
        moves += isinstance(item, JointMove)
        if isinstance(item, Centre):
            out.append((moves, item.ball, item.pose))
    return tuple(out)


def _too_round(program: Program, dialect: Dialect, found: ReadBack) -> Iterator[str]:
    """Turn each printed rounding back into millimetres on both legs of its corner."""
    points = (program.home_deg, *(m.q_deg for m in program.moves))
    for index, (move, read) in enumerate(zip(program.moves, found.moves, strict=True)):
        allowed, value = move.blend_mm, read.blend
        if value is None:
            continue
        for leg in (index, index + 1):
            if leg >= len(program.moves):
                yield f"move {index + 1} is the last and does not stop"
                continue
            round_leg = program.moves[leg].via_deg is not None
            cut = (
                value
                if round_leg
                else _cut_mm(dialect, value, points[leg], points[leg + 1], program.moves[leg].travel_mm)
            )
            if allowed <= 0.0 or not cut <= allowed * ROUNDING_RATIO:
                yield f"move {index + 1} rounds its corner by {cut:.2f} mm, planned are {allowed:.2f} mm"


def _other_circles(program: Program, dialect: Dialect, found: ReadBack) -> Iterator[str]:
    """Compare which moves are circles of the tool, and their middle points."""
    planned = {k: m.via_deg for k, m in enumerate(program.moves) if m.via_deg is not None}
    read = {k: m.via_deg for k, m in enumerate(found.moves) if m.via_deg is not None}
    if read.keys() != planned.keys():
        yield f"{len(read)} of its moves are circles, planned are {len(planned)}, or they are others"
        return
    for k, via in planned.items():
        if (np.abs(np.subtract(via, read[k])) > _resolution(program, dialect)).any():
            yield f"the circle of move {k + 1} leads through another point than planned"


def _resolution(program: Program, dialect: Dialect) -> Array:
    """Return by how much a printed angle of each axis, or of all, may differ [deg]."""
    return dialect.resolution_deg(program.pulses_per_deg) * ROUNDING_RATIO + 1e-9


def _cut_mm(
    dialect: Dialect, value: float, start: tuple[float, ...], end: tuple[float, ...], travel_mm: float
) -> float:
    match dialect.blend.kind:
        case "mm":
            return value
        case "percent":
            return value / 100.0 * travel_mm / 2.0
        case "path_degrees":
            length = math.dist(start, end)
            return value / length * travel_mm if length else 0.0
        case "dense":
            step = max(abs(b - a) for a, b in zip(start, end, strict=True))
            return 0.0 if step <= dialect.blend.dense_deg else travel_mm / 2.0
        case "none":
            return travel_mm / 2.0


def _wrong_starts(program: Program, dialect: Dialect, found: ReadBack) -> Iterator[str]:
    """Compare what a later start leaves out, and the ways to the starts."""
    if found.stretches != program.stretches:
        yield "it leaves out other stretches than planned where it is started later"
    if [at for at, _ in found.entries] != [e.at for e in program.entries]:
        yield "it has other starts than planned"
        return
    for entry, (_, read) in zip(program.entries, found.entries, strict=True):
        planned, path_deg = np.array([m.q_deg for m in entry.moves]), np.array([m.angles_deg for m in read])
        if path_deg.shape != planned.shape or (np.abs(path_deg - planned) > 2.0 * _resolution(program, dialect)).any():
            yield f"the path to start {entry.at} is another than planned"
            continue
        way = f"on the path to start {entry.at} move"
        yield from _too_fast(dialect, entry.origin_deg, entry.moves, read, way)


def _too_fast(
    dialect: Dialect,
    origin_deg: tuple[float, ...],
    moves: tuple[JointMove, ...],
    found: tuple[ReadMove, ...],
    what: str,
) -> Iterator[str]:
    starts = (origin_deg, *(m.q_deg for m in moves))
    for number, (move, start, read) in enumerate(zip(moves, starts, found, strict=False), start=1):
        first, value = number == 1 and what == "move", read.speed  # it begins anywhere, at a speed of its own
        match dialect.speed.kind:
            case _ if move.via_deg is not None:  # of a circle the speed word is that of the tool [mm/s]
                ratio = value / move.tool_speed_mm_s
            case "axis_percent":
                ratio = value / move.axis_percent
            case "tool_speed":
                per_second = value / (60.0 if dialect.speed.unit == "mm/min" else 1.0)
                ratio = per_second / max(move.tool_speed_mm_s, 0.1)
            case "inverse_time":
                ratio = value / float(dialect.speed.approach or "inf") if first else value / 60.0 * move.duration_s
            case "leading_axis":
                planned = leading_speed(move, start)
                ratio = value / planned if planned and not first else 0.0
            case "duration":
                ratio = 0.0 if first else move.duration_s / value
        if not ratio <= ROUNDING_RATIO:
            yield f"{what} {number} is driven at {100.0 * ratio:.1f} % of the planned speed"


def write_program(program: Program, dialect_name: str, stem: str) -> tuple[ProgramFile, ...]:
    """Return the files of ``program`` in a dialect, already read back and compared with the plan.

    Args:
        program: what the robot shall do.
        dialect_name: a name of `dialects`, or ``name+option``.
        stem: wanted name; brought into the form that the controller takes.

    Raises:
        InputError: no such dialect, or it cannot carry the program.
        ProgramMismatchError: the text does not do what was planned.
    """
    return write_and_read_back(program, dialect_name, stem)[0]


def write_and_read_back(program: Program, dialect_name: str, stem: str) -> tuple[tuple[ProgramFile, ...], ReadBack]:
    """Return what :func:`write_program` returns, and what was read back of it."""
    dialect = load_dialect(dialect_name)
    files = render_program(program, dialect, stem)
    return files, check_program(program, dialect, tuple(f.text for f in files))


def program_notes(program: Program, dialect_name: str) -> tuple[str, ...]:
    """Return what a person must know of ``program`` in a dialect before it is started, one sentence each.

    Raises:
        InputError: no such dialect, or it cannot carry the program.
    """
    dialect = load_dialect(dialect_name)
    program = program if dialect.resume else program.without_starts()
    return operator_cautions(program, dialect, lower_program(program, dialect))


def shared_notes(programs: Mapping[str, Program]) -> tuple[str, ...]:
    """Return the notes of a session's programs, one a dialect; what several share is said once."""
    said: dict[str, list[str]] = {}
    for name, program in programs.items():
        for text in program_notes(program, name):
            said.setdefault(text, []).append(name)
    return tuple(f"{', '.join(names)}: {text}" for text, names in said.items())


def import_map(dialect_name: str, n_joints: int, slides: int = 0) -> str:
    """Return the column map (TOML) with which the controller's own log of the axes is imported.

    ``slides``: how many of the axes, the last ones, slide.

    Raises:
        InputError: the dialect keeps no log.
    """
    dialect = load_dialect(dialect_name)
    log = dialect.log
    if log is None:
        raise InputError(f"{dialect.title} keeps no log of its own axes; record them with the controller's trace")
    turning = n_joints - slides
    lines = ['schema = "edbb-map/1"', *(f"# {line}" for line in log.note.splitlines())]
    lines += [f'axes_of = "{dialect_name.partition("+")[0]}"']
    lines += [f'encoding = "{log.encoding}"', f'decimal = "{log.decimal}"']
    if log.row is not None:
        axes = (log.axis.format(axis=a, joint=i) for i, a in enumerate(dialect.axes[:n_joints], start=1))
        axes = (a if i < turning else a.replace("_deg>", "_mm>") for i, a in enumerate(axes))
        lines.append(f"pattern = '{log.row.format(axes=','.join(axes))}'")
    else:
        lines += [f'separator = "{log.separator}"', "header = false", "[columns]", "pose = 1"]
        lines += [f"{log.columns}{i}_{'deg' if i <= turning else 'mm'} = {i + 1}" for i in range(1, n_joints + 1)]
    return "\n".join(lines) + "\n"
