"""Programs read back by name of their dialect, and held against what was planned."""

import tests.programs.sessions as sessions
from planner.programs.dialect import load_dialect
from planner.programs.verification import check_program, read_texts


def read_back(dialect_name, files):
    """What the files make the robot do, read without the code that wrote them."""
    dialect = load_dialect(dialect_name)
    return read_texts(dialect, [f.text for f in files], pulses_per_deg=sessions.PULSES[: dialect.max_joints])


def blends(found):
    """The rounding word of every move, None where it is an exact stop."""
    return [move.blend for move in found.moves]


def verify(program, dialect_name, files):
    """Read the files back and compare them with the program within the printed resolution."""
    return check_program(program, load_dialect(dialect_name), [f.text for f in files])
