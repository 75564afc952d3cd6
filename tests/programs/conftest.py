"""What a test asks of a dialect before it looks at its program."""

from functools import cache

import pytest

from planner.programs.dialect import load_dialect
from planner.programs.languages.declared import Position
from planner.programs.verification import EXECUTIONS
from tests.programs.reading import write_program
from tests.programs.sessions import static


@pytest.fixture
def by_lines(name):
    """Skip a dialect whose program says a position apart from its move, and not both in one statement.

    It is asked here and not at collection: each process would spend seconds to write in every language.
    """
    if not _says_moves_in_lines(name):
        pytest.skip("its positions stand apart from its moves")


@cache
def _says_moves_in_lines(name):
    dialect = load_dialect(name)
    texts = tuple(f.text for f in write_program(static(), name, "a"))
    statements = EXECUTIONS[dialect.reading.family](dialect).parse(texts)
    return any("-60.0000" in s.text for s in statements if not isinstance(s, Position))
