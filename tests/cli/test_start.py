"""The command starts with what the called verb needs, and its help says what a person can type."""

import inspect
import json
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

import planner
from planner.cli.app import command_function, verbs
from planner.kinematics import robot_reader
from tests.command import commands_that_run, edbb

HEAVY = {"ompl", "fcl", "polars", "matplotlib", "plotly", "scipy.stats", "scipy.optimize"}
LOADED = """
import sys
from planner.cli.app import app
app({words}, standalone_mode=False)
print("loaded:", *sorted({heavy} & set(sys.modules)))
"""


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--help"], ["robots"], ["robots", "--json"], ["dialects"]], ids=" ".join)
def test_commands_that_only_list_load_no_library_of_planning_or_fitting(words):
    code = LOADED.format(words=words, heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].split() == ["loaded:"]


def test_the_help_of_a_command_loads_no_library_of_numbers():
    code = f"import sys; from planner.cli.app import load_command; [load_command(x) for x in {commands_that_run()}]; "
    code += f"print(*sorted({HEAVY | {'numpy', 'pydantic', 'pinocchio', 'scipy'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_verb_is_there_and_is_called():
    for name in commands_that_run():
        line = verbs()[name]
        own = inspect.getdoc(command_function(name)).split()
        assert {w.strip(".,:").lower() for w in line.split()} & {w.strip(".,:").lower() for w in own}, name
    listed = edbb("--help").stdout
    found = [n for n in re.findall(r"^│ ([\w-]+) {2,}\w", listed, re.MULTILINE) if n in verbs()]
    assert sorted(found) == sorted(verbs())  # by what they are for, each once


@pytest.mark.parametrize("verb", [[], ["plan"], ["identify"]], ids=str)
def test_switches_take_no_value_in_the_help(verb):
    text = edbb(*verb, "--help").stdout
    assert "--help" in text
    assert "bool" not in text.lower()


def test_a_word_that_is_no_verb_names_the_nearest():
    done = edbb("pla")
    assert done.returncode == 2
    assert "Did you mean 'plan'" in done.screen


def test_words_of_files_are_printed_as_they_stand(monkeypatch):
    assert "edbb: :car:.toml" in edbb("simulate", ":car:.toml", "-o", "nowhere.csv").screen
    title = "TX60 [/60] :car: [red]"
    robot = replace(robot_reader.load_robot("ur10"), title=title)
    monkeypatch.setattr(robot_reader, "load_robot", lambda name: robot)
    assert edbb("robots").stdout.count(title) == len(robot_reader.list_robots())


def test_a_language_that_counts_in_pulses_has_no_resolution_in_degrees():
    assert re.search(r"inform .* 1 pulse ", edbb("dialects").stdout)
    resolution = {d["name"]: d["resolution_deg"] for d in json.loads(edbb("dialects", "--json").stdout)}
    assert (resolution["inform"], resolution["krl"]) == (None, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["", " "])
def test_an_empty_name_is_no_folder(name, tmp_path):
    done = edbb("plan", "ur10/edbb", "-o", name, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "edbb: -o '': names no folder; '-o .' would be the one that you are in\n"
    assert not list(tmp_path.iterdir())


def test_the_installed_command_is_the_one_of_the_package():
    """The entry point in pyproject.toml names a function that is there."""
    root = Path(planner.__file__).parents[1]
    entry = tomllib.loads((root / "pyproject.toml").read_text())["project"]["scripts"]["edbb"]
    module, function = entry.split(":")
    assert callable(getattr(import_module(module), function))
