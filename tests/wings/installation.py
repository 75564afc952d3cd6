"""An installation of the planner from which extensions are left out: a copy of the tree without their files."""

import ast
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import planner
from planner.common.extensions import shipped_extensions

ROOT = Path(planner.__file__).parents[1]
WINGS = {module.rpartition(".")[2]: module for module in shipped_extensions()}
"""Module of each extension that is shipped, by its name."""


def parts_of(wing):
    """The files and folders of an extension, from the folder of the package."""
    return [f"wings/{wing}.py", *import_module(WINGS[wing]).PARTS, *map(cell_part, cells_of(wing))]


def cells_of(wing):
    """The shipped cells that only an extension reads, ``robot/cell`` each."""
    return getattr(import_module(WINGS[wing]), "CELLS", ())


def cell_part(name):
    """The file of a shipped cell, from the folder of the package."""
    robot, cell = name.split("/")
    return f"../robots/{robot}/cells/{cell}.toml"


def files_of(wing):
    """All its files of Python, and its cells."""
    home = ROOT / "planner"
    for part in parts_of(wing):
        yield from (home / part).rglob("*.py") if (home / part).is_dir() else [(home / part).resolve()]


def needed_by(wing):
    """The extensions that one needs, as its commands say."""
    tree = ast.parse((ROOT / "planner" / "wings" / f"{wing}.py").read_text())
    return {name for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == "needs"
            for name in ast.literal_eval(node.value)}  # fmt: skip


def install_without(folder, *wings):
    """Copy the package with its robots and languages into a folder, without some extensions; return the environment."""
    if sys.flags.ignore_environment:
        pytest.skip("this Python does not look at PYTHONPATH")
    for name in ("planner", "robots", "g-code"):
        shutil.copytree(ROOT / name, folder / name)  # compiled modules too: they hold, and are no modules by themselves
    for wing in wings:
        for part in parts_of(wing):
            there = folder / "planner" / part
            shutil.rmtree(there) if there.is_dir() else there.unlink()
    return {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "120"}


def run_in(folder, environment, *words):
    """Run Python with words in a folder of an installation."""
    return subprocess.run(
        [sys.executable, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def edbb_in(folder, environment, *words):
    """Run a command of an installation."""
    return run_in(folder, environment, "-m", "planner.cli", *words)
