"""Which tests are of the core: those that need no module of an extension, themselves or by what they import."""

import ast
import re
import shutil
from functools import cache

from tests.wings.installation import ROOT, WINGS, cell_part, cells_of, files_of, install_without, needed_by, run_in

ROOMS = (
    "cell", "cli", "common", "compensation", "design", "effects", "gauges", "identification", "kinematics", "motion",
    "programs", "report", "runs", "simulation", "tracing", "workflow",
)  # fmt: skip


CELLS = {name for wing in WINGS for name in cells_of(wing)}

OF_ALL_COMMANDS = (
    "tests/cli/test_recommended.py",
    "tests/cli/test_groups.py::test_the_documentation_has_the_same_groups",
    "tests/cli/test_groups.py::test_the_help_shows_every_command_under_its_group",
    "tests/cli/test_json.py::test_there_are_commands_with_json",
    "tests/cli/test_time_left.py::test_the_long_commands_say_when_their_stages_begin",
)
"""Tests that list every command there is, those of the shipped extensions among them."""


def _module_files(name, names=()):
    """The files that an import of a module, and of names from it, may read."""
    base = ROOT.joinpath(*name.split("."))
    tried = [base.with_suffix(".py"), base / "__init__.py", *((base / n).with_suffix(".py") for n in names)]
    return {path for path in tried if path.is_file()}


def _is_ours(name):
    return name.partition(".")[0] in ("planner", "tests")


@cache
def _needs(path):
    """The files of planner and tests that a file imports or names in a text, and the settings that pytest reads."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.ImportFrom(module=str(module), names=names) if _is_ours(module):
                found |= _module_files(module, [n.name for n in names])
            case ast.Import(names=names):
                found |= {f for n in names if _is_ours(n.name) for f in _module_files(n.name)}
            case ast.Constant(value=str(text)) if "planner." in text:  # a module's name, or code that imports some
                for module in re.findall(r"\bplanner(?:\.\w+)+", text):
                    found |= _module_files(module) | _module_files(module.rpartition(".")[0])
            case ast.Constant(value=str(text)) if text in CELLS:
                found.add((ROOT / "planner" / cell_part(text)).resolve())
    settings = (folder / "conftest.py" for folder in path.parents if folder.is_relative_to(ROOT / "tests"))
    return found | {f for f in settings if f.is_file() and path.name != "conftest.py"}


def _reached(path):
    """All files of tests that a test imports, and the modules of the planner that these name."""
    seen, open_ = set(), [path]
    while open_:
        file = open_.pop()
        if file not in seen:
            seen.add(file)
            open_ += _needs(file) if file.is_relative_to(ROOT / "tests") else ()
    return seen


def core_tests(*wings):
    """The tests of the core's rooms that name no module of these extensions or of one that needs them, as paths."""
    without = {w for w in WINGS if w in wings or needed_by(w) & set(wings)}
    taken = {f for wing in without for f in files_of(wing)}
    tests = [path for room in ROOMS for path in sorted((ROOT / "tests" / room).rglob("test_*.py"))]
    return [str(path.relative_to(ROOT)) for path in tests if not taken & _reached(path)]


def install_with_tests(folder, *wings):
    """Copy the package without some extensions, and with its tests and what they read; return the environment."""
    environment = install_without(folder, *wings)
    for name in ("tests", "docs", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, folder / name)
    return environment


def run_tests(folder, environment, tests, *words):
    """Run tests in an installation, in one process."""
    left = [word for test in OF_ALL_COMMANDS for word in ("--deselect", test)]
    return run_in(
        folder, environment, "-m", "pytest", "-n", 0, "-p", "no:cacheprovider", "-m", "not long", *left, *words, *tests
    )


__all__ = ["ROOMS", "WINGS", "core_tests", "install_with_tests", "run_tests"]
