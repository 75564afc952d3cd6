"""Tests are collected on every system: none imports at its head what one system, or one without planning, lacks."""

import ast
from pathlib import Path

import pytest

from tests.not_everywhere import MODULES

TESTS = Path(__file__).parents[1]
BY_HAND = {"benchmarks", "linuxcnc"}  # programs that a person runs; a machine that is not there on other systems


def heads(tree):
    """Names of the modules that are imported as a file is."""
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield str(node.module).partition(".")[0]


@pytest.mark.slow
def test_no_test_imports_a_module_of_one_system_or_of_planning_at_its_head():
    files = [p for p in TESTS.rglob("*.py") if not BY_HAND & set(p.parts)]
    assert len(files) > 300
    at_head = {p: MODULES & set(heads(ast.parse(p.read_text(encoding="utf-8")))) for p in files}
    assert not {p: found for p, found in at_head.items() if found}
