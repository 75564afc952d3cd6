"""Programs written and read back by their dialect's name, each once in a process, and held against what was planned."""

from functools import lru_cache

import tests.programs.sessions as sessions
from planner.programs import verification
from planner.programs.dialect import load_dialect
from planner.programs.verification import check_program, read_texts


@lru_cache(maxsize=1000)
def write_program(program, dialect_name, stem):
    """The files of a program: many tests look at those of the same few sessions in every language."""
    return verification.write_program(program, dialect_name, stem)


def read_back(dialect_name, files):
    """What the files make the robot do, read without the code that wrote them."""
    return _read_texts(dialect_name, tuple(f.text for f in files))


@lru_cache(maxsize=1000)
def _read_texts(dialect_name, texts):
    dialect = load_dialect(dialect_name)
    return read_texts(dialect, list(texts), pulses_per_deg=sessions.PULSES[: dialect.max_joints])


def blends(found):
    """The rounding word of every move, None where it is an exact stop."""
    return [move.blend for move in found.moves]


def verify(program, dialect_name, files):
    """Read the files back and compare them with the program within the printed resolution."""
    return check_program(program, load_dialect(dialect_name), [f.text for f in files])
