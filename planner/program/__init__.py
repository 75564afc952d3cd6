"""Robot programs: a neutral list of instructions, written in a controller's dialect and read back.

    files = write_program(program, "krl", "nj130_edbb")   # rendered, read back, compared: or an error
    for file in files:
        planner.files.write_text(folder / file.name, file.text, file.encoding)

A dialect is a folder ``g-code/<name>`` with two files and no line of Python:

``dialect.toml``
    What the controller takes: names and number of its axes, decimals, line ends and limits, comment,
    the kind and word of its blending (``none``, ``mm``, ``percent`` of half the leg, ``path_degrees``,
    or ``dense``: only a path in small steps runs without stops), the kind and word of its speed
    (``axis_percent``, ``tool_speed``, ``inverse_time``), dwell, the pulse at a pose standing still and in
    passing, pause, wait, the log of its own axes, the words that select tool, base and load, the call of a
    centring routine under ``[centre]``, and under
    ``[reading]`` the family of the reader. Every key is checked; a wrong one is named.
``program.j2``
    A Jinja2 template with a macro ``step(s)``, which prints one step (``s.kind`` is one of move, dwell,
    sync, sync_on, sync_off, log, log_passing, unlogged, centre, pause, wait, comment, section, override), and a
    macro ``main(parts)``, which prints the file around the parts' lines; ``part(part)`` and
    ``data(parts)`` where ``[files]`` names such files. ``d`` is the dialect, ``p`` the program, ``name``
    its name, ``rows`` the steps that log, ``passing`` those of them that log while the robot moves,
    ``overridden`` whether the override is scaled, ``remarks`` what the head of the program tells the
    operator. An undefined name is an error.

To add one: copy the nearest folder, change both files, run the tests: they take every folder that is there.
"""

from planner.program.catalogue import (
    DialectInfo,
    dialects,
    import_map,
    info,
    program_notes,
    read_back,
    verify,
    write_program,
)
from planner.program.instructions import (
    Centre,
    Comment,
    Dwell,
    Instruction,
    JointMove,
    LogAxes,
    Pause,
    Program,
    Section,
    Sync,
    WaitInput,
)
from planner.program.reading import ReadBack
from planner.program.rendering import ProgramFile
from planner.program.verification import ProgramMismatchError

__all__ = [
    "Centre",
    "Comment",
    "DialectInfo",
    "Dwell",
    "Instruction",
    "JointMove",
    "LogAxes",
    "Pause",
    "Program",
    "ProgramFile",
    "ProgramMismatchError",
    "ReadBack",
    "Section",
    "Sync",
    "WaitInput",
    "dialects",
    "import_map",
    "info",
    "program_notes",
    "read_back",
    "verify",
    "write_program",
]
