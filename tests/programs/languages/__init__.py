"""What the tests know of each language from its maker's manuals, a module a family: ``NAME`` or ``test_NAME``.

A module has ``REFUSED``, statements of the language that no program of the planner may hold; ``OVERRIDE``, how it says
speeds and reaches the operator's override, where its controller has one; and ``DIALECTS``, facts of each dialect.
"""

from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from planner.programs.dialect import load_dialect
from planner.programs.rendering import ProgramFile
from tests.programs.controllers import DialectFacts, Language


@cache
def facts_of(family: str) -> ModuleType:
    """The module of a family."""
    found = next((n for n in (f"{__name__}.test_{family}", f"{__name__}.{family}") if find_spec(n)), None)
    assert found, f"the language '{family}' has no module in tests/programs/languages (docs/extend/dialect.md)"
    return import_module(found)


def dialect_facts(name: str) -> DialectFacts:
    """The facts of a dialect."""
    return facts_of(load_dialect(name).reading.family).DIALECTS[name]


def targets_first(name: str, files: tuple[ProgramFile, ...]) -> list[ProgramFile]:
    """The files of a program, the one that holds its positions before the others."""
    k = dialect_facts(name).targets
    return [files[k], *files[:k], *files[k + 1 :]]


def override_of(name: str) -> Language | None:
    """How the language of a dialect reaches the override; None where its receiver has none."""
    return getattr(facts_of(load_dialect(name).reading.family), "OVERRIDE", None)
