"""With ``--json`` standard output is JSON for every command, whatever the libraries beneath print, and when."""

import json
import subprocess
import sys

import pytest

from planner.cli.app import command_function, load_command
from tests.command import commands_that_run, edbb

COMMANDS = [name for name in commands_that_run() if "as_json" in command_function(name).__annotations__]
QUICK = ("plan", "identify", "robots", "record")  # declared once for all doors, and typed for the terminal
CHATTY = """
import ctypes, functools, os, subprocess, sys
from planner.cli import app, terminal
from planner.common.quiet import C_LIBRARY

plain = app.command_function

def chatty(name):
    function = plain(name)

    @functools.wraps(function)
    def run(**values):
        assert values["as_json"] is True
        os.write(1, b"a banner before\\n")
        terminal.print_json({"command": name})
        ctypes.CDLL(C_LIBRARY).puts(b"a banner that waits in the buffer of the C library")
        subprocess.run([sys.executable, "-c", "print('a program')"], check=True)
        print("more", end="") if "more" in os.environ else None

    return run

app.command_function = chatty
app.main()
"""


def chatty(words, **how):
    return subprocess.run([sys.executable, "-c", CHATTY, *words], capture_output=True, text=True, check=False, **how)


def needed_words(name, file):
    """What the command cannot do without."""
    needed = [p for p in load_command(name).params if p.required]
    options = [w for p in needed if p.param_type_name == "option" for w in (p.opts[0], str(file))]
    return [*options, *(str(file) for p in needed if p.param_type_name == "argument")]


def test_there_are_commands_with_json():
    assert {"plan", "identify", "check", "robots", "loaded-places"} <= set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in COMMANDS])
def test_what_libraries_print_is_not_among_the_results(tmp_path, name):
    (tmp_path / "file").touch()
    done = chatty([name, *needed_words(name, tmp_path / "file"), "--json"])
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"command": name}
    for said in ("a banner before", "buffer of the C library", "a program"):
        assert said in done.stderr  # it is not lost either


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("compensate", "none.src", "--model", "comau-nj130", "-o", "out.src"), 2),
        (("identify", "none.csv", "--cell", "ur10/none", "-o", "out"), 2),
        (("simulate", "none.json", "-o", "out.csv"), 2),
    ],
)
def test_an_error_leaves_standard_output_empty(words, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = edbb(*words, "--json")
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.strip()


@pytest.mark.slow
@pytest.mark.posix
def test_it_needs_no_standard_error():
    command = 'exec 2>&-; exec "$0" -m planner.cli robots --json'
    done = subprocess.run(["bash", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    assert len(json.loads(done.stdout)) > 5


@pytest.mark.slow
@pytest.mark.posix
def test_a_reader_that_goes_away_ends_it_quietly():
    command = '"$0" -m planner.cli robots --json | head -c 1'
    done = subprocess.run(["bash", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[", "")


@pytest.mark.long
def test_a_plan_is_json_though_its_solver_prints_a_banner(tmp_path, small):
    cell = small.cell_path
    done = edbb("plan", cell, "-o", tmp_path / "out", "--poses", 30, "--json", "--dialect", "krl", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["plan_id"] == small.plan["plan_id"]
    assert "HiGHS" not in done.stderr  # nor does the banner trouble a person
