"""Write a program in a dialect, read it back, verify it."""

from collections.abc import Mapping, Sequence

from planner.common.errors import InputError
from planner.programs.dialect import load_dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import ReadBack
from planner.programs.rendering import ProgramFile, operator_cautions, render_program
from planner.programs.steps import lower_program
from planner.programs.verification import check_program, read_texts


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
    return write_checked(program, dialect_name, stem)[0]


def write_checked(program: Program, dialect_name: str, stem: str) -> tuple[tuple[ProgramFile, ...], ReadBack]:
    """Return what :func:`write_program` returns, and what was read back of it."""
    dialect = load_dialect(dialect_name)
    files = render_program(program, dialect, stem)
    return files, check_program(program, dialect, _texts(files))


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


def read_back(dialect_name: str, files: Sequence[ProgramFile]) -> ReadBack:
    """Return what ``files`` make the robot do, read without the code that wrote them.

    Raises:
        InputError: no such dialect, or a line that is not of it.
    """
    return read_texts(load_dialect(dialect_name), _texts(files))


def verify(program: Program, dialect_name: str, files: Sequence[ProgramFile]) -> ReadBack:
    """Read ``files`` back and compare them with ``program`` within the printed resolution.

    Raises:
        InputError: no such dialect.
        ProgramMismatchError: the files do something else; no such program may be released.
    """
    return check_program(program, load_dialect(dialect_name), _texts(files))


def import_map(dialect_name: str, n_joints: int) -> str:
    """Return the column map (TOML) with which the controller's own log of the axes is imported.

    Raises:
        InputError: the dialect keeps no log.
    """
    dialect = load_dialect(dialect_name)
    log = dialect.log
    if log is None:
        raise InputError(f"{dialect.title} keeps no log of its own axes; record them with the controller's trace")
    lines = ['schema = "edbb-map/1"', *(f"# {line}" for line in log.note.splitlines())]
    lines += [f'encoding = "{log.encoding}"', f'decimal = "{log.decimal}"']
    if log.row is not None:
        axes = (log.axis.format(axis=a, joint=i) for i, a in enumerate(dialect.axes[:n_joints], start=1))
        lines.append(f"pattern = '{log.row.format(axes=','.join(axes))}'")
    else:
        lines += [f'separator = "{log.separator}"', "header = false", "[columns]", "pose = 1"]
        lines += [f"{log.columns}{i}_deg = {i + 1}" for i in range(1, n_joints + 1)]
    return "\n".join(lines) + "\n"


def _texts(files: Sequence[ProgramFile]) -> tuple[str, ...]:
    return tuple(f.text for f in files)
