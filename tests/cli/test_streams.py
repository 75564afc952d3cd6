"""Results and their notes go to standard output, progress to standard error; exit codes say what was judged."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from planner.cli import declared
from planner.cli.app import GREETING, WITH_MORE
from planner.cli.declared import complete_cell, file_of, new_file, new_folder, new_folder_of_files
from planner.common.calls import typed_fields
from planner.common.commands import extension_commands
from planner.common.errors import did_you_mean
from planner.common.progress import Stages
from planner.workflow import checking
from planner.workflow.verbs import declared_calls
from tests.command import commands_that_run, edbb
from tests.docs.test_pages import ROOT

PLAN = ROOT / "tests" / "data" / "kr6-plan" / "plan.json"
CELLS = ["kuka-kr6-r700/edbb", "kuka-kr6-r700/tracker", "ur10/edbb", "ur5e/edbb"]


@pytest.mark.slow
def test_a_simulated_run_says_its_result_on_standard_output(tmp_path):
    done = edbb("simulate", PLAN, "-o", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    assert "next" in done.stdout
    assert "next" not in done.stderr
    piped = edbb("simulate", PLAN, "-o", "-")
    assert piped.stdout == (tmp_path / "run.csv").read_text()  # nothing but the file


@pytest.mark.slow
def test_without_a_place_each_result_gets_a_new_one_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("simulate-kr6-plan.csv", "simulate-kr6-plan-2.csv"):
        done = edbb("simulate", PLAN)
        assert done.returncode == 0, done.stderr
        assert name in done.stdout
        assert (tmp_path / name).is_file()
    done = edbb("export", PLAN, "--dialect", "krl")
    assert done.returncode == 0, done.stderr
    assert {p.suffix for p in (tmp_path / "export-kr6-plan").iterdir()} == {".src", ".dat"}


def test_names_of_what_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan-ur10-edbb").mkdir()
    (tmp_path / "plan-ur10-edbb" / "plan.json").touch()
    assert str(new_folder("plan", "ur10/edbb")) == "plan-ur10-edbb-2"
    assert str(new_folder("plan", "mine/hall 3.toml")) == "plan-hall-3"
    assert new_file(".csv")("simulate", "plan-ur10-edbb/plan.json") == "simulate-ur10-edbb.csv"
    assert str(new_folder("identify", ["simulate-ur10-edbb.csv", "second.csv"])) == "identify-ur10-edbb"
    assert new_folder_of_files("compensate", "part.src") == "compensate-part/"
    (tmp_path / "measure-ur10-edbb.csv").touch()
    assert file_of(".csv")("measure", "plan-ur10-edbb/plan.json") == "measure-ur10-edbb.csv"  # goes on in it


TYPED = {n for n, c in extension_commands().items() if c.typed} | WITH_MORE.keys()  # have functions of their own
FOLDER_VERBS = [n for n in commands_that_run() if n in declared_calls() and n not in TYPED]


def least_words(verb):
    """What must be typed of a command."""
    words = []
    for f in typed_fields(declared_calls()[verb]):
        value = "1" if f.kind in (int, float) else "x"
        words += [] if not f.is_required else [value] if f.option.is_word else [f.flag, value]
    return words


@pytest.mark.parametrize(("failed", "code"), [(False, 0), (True, 3)])
@pytest.mark.parametrize("verb", FOLDER_VERBS)
def test_a_result_goes_to_standard_output_and_progress_elsewhere(verb, failed, code, tmp_path, monkeypatch):
    def work(progress, **_):
        with Stages(progress).stage("search") as say:
            say(1, 2)
        return Judged(failed)

    monkeypatch.setattr(declared, "find_function", lambda call: work)
    monkeypatch.setenv("EDBB_PROGRESS", "json")
    done = edbb(verb, *least_words(verb), "-o", tmp_path / "out")
    assert done.returncode == code, done.stderr
    assert done.stdout.startswith(f"judged\n  written to  {tmp_path / 'out'}")
    assert {json.loads(line)["stage"] for line in done.stderr.splitlines()} == {"search"}
    assert (tmp_path / "out" / "check.json").is_file()


def test_a_check_that_failed_is_a_failed_result():
    for passed in (True, False):
        result = object.__new__(checking.CheckResult)
        object.__setattr__(result, "verdict", SimpleNamespace(passed=passed))
        assert result.is_failed is not passed


class Judged(checking.FolderResult):
    """A verdict without a run."""

    main_file = "check.json"

    def __init__(self, failed):
        self._failed = failed

    @property
    def is_failed(self):
        return self._failed

    def overview(self):
        return replace(checking.Summary(""), title="judged")

    def content(self):
        return {}

    def fill(self, draft):
        pass

    def files(self, folder):
        return self.main_file


def test_the_command_alone_greets_in_three_lines():
    done = edbb()
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{GREETING}\n", "")
    assert len(GREETING.splitlines()) == 3
    assert "edbb demo" in GREETING


@pytest.mark.parametrize("words", [[], ["plan"], ["measure"], ["serve"]], ids=str)
def test_h_asks_for_help(words):
    assert edbb(*words, "-h").stdout == edbb(*words, "--help").stdout


@pytest.mark.slow
def test_the_shell_completes_commands_and_options():
    asked = {"_PYTHON _M PLANNER.CLI_COMPLETE": "complete_bash"}
    done = edbb(cwd=".", COMP_WORDS="edbb plan --ti", COMP_CWORD="2", **asked)
    assert done.stdout.split() == ["--time-limit-s"]


def test_the_shell_completes_cells():
    assert complete_cell("ur10") == ["ur10/edbb"]
    assert complete_cell("kuka") == [f"kuka-kr6-r700/{gauge}" for gauge in ("edbb", "tracker", "trical")]
    assert complete_cell("/tmp/mine") == []


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("kr6", '"kuka-kr6-r700/edbb" or "kuka-kr6-r700/tracker"'),
        ("kr6/edbb", '"kuka-kr6-r700/edbb"'),
        ("kr10/edbb", '"kuka-kr6-r700/edbb"'),
        ("ur1O/edbb", '"ur10/edbb"'),
        ("ur10/edb", '"ur10/edbb"'),
    ],
)
def test_a_part_of_a_name_is_enough(word, meant):
    assert did_you_mean(word, CELLS) == f"; did you mean {meant}?"


def test_a_robot_is_found_by_part_of_its_name_or_title():
    assert edbb("robots", "kr6").stdout.count("kuka-kr6-r700/edbb") == 1
    done = edbb("robots", "kr10")
    assert done.returncode == 2
    assert '"kuka-kr6-r700"' in done.stderr
    assert "edbb robots ROBOT -o mine" in done.stderr
