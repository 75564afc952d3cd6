"""One thing has one name; the name of the version before goes on working, with a notice."""

import re
import warnings
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated

import pytest

import planner
from planner.cli.app import load_command, verbs
from planner.cli.former_names import former_options, take_former_options
from planner.common.calls import Call, Option, called_with, typed_fields
from planner.service.job_requests import REQUESTS
from planner.workflow.verbs import declared_calls
from tests.command import edbb

VOCABULARY = Path(planner.__file__).parents[1] / "docs/commands.md"
FORMER = [(verb, old, new) for verb in verbs() for old, new in former_options(verb).items()]
ONLY_PYTHON = {"--map": "map_file"}  # "map" is a function of Python
OTHERWISE = {"--places", "--unloaded"}  # what each command means by it stands in the table


@pytest.mark.parametrize(("verb", "old", "new"), FORMER)
def test_a_former_option_is_taken_for_todays_and_said(verb, old, new, capsys):
    names = {p.name: p.opts for p in load_command(verb).params}
    assert any(new in opts for opts in names.values())
    assert not any(old in opts for opts in names.values())
    assert take_former_options(verb, ["a", old, "x", f"{old}=y", "--", old]) == ["a", new, "x", f"{new}=y", "--", old]
    said = capsys.readouterr().err.splitlines()
    assert said == [f"edbb {verb}: {old} is called {new} now; the old name works in this version only"]
    assert take_former_options(verb, ["a", new, "x"]) == ["a", new, "x"]
    assert not capsys.readouterr().err


def test_a_command_with_a_former_option_runs(tmp_path):
    done = edbb("check", tmp_path / "run.csv", "--baseline", tmp_path, "--cell", "ur10/edbb", "-o", tmp_path / "out")
    assert "--baseline is called --model now" in done.stderr
    assert "No such option" not in done.stderr
    assert "posterior.json is missing" in done.stderr
    assert done.returncode == 2


@dataclass(frozen=True)
class LookCall(Call):
    """Look at a robot."""

    verb = "look"
    _: KW_ONLY
    model: Annotated[str, Option("a robot", former="--base-line")]


@called_with(LookCall)
def look(asked: LookCall) -> str:
    """Look at it."""
    return asked.model


def test_a_former_keyword_of_python_is_taken_with_a_warning():
    with pytest.warns(DeprecationWarning, match=r"look\(\): base_line= is called model= now"):
        assert look(base_line="a") == "a"  # type: ignore[call-arg]  # what is tested
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert look(model="b") == "b"


@pytest.mark.parametrize(
    ("kind", "former", "today"),
    [
        ("plan", {"cell": "ur10/edbb", "dialects": ["krl"]}, {"cell": "ur10/edbb", "dialect": ["krl"]}),
        ("check-plan", {"identification": "0" * 24}, {"model": "0" * 24}),
        ("error-map", {"identification": "0" * 24}, {"model": "0" * 24}),
        ("check", {"check_plan": "0" * 24}, {"plan": "0" * 24}),
    ],
)
def test_a_request_with_a_former_name_is_the_same_request(kind, former, today):
    rest = {"run": {"id": "0" * 64, "name": "r.csv"}} if kind == "check" else {}
    request = REQUESTS[kind]
    assert request.model_validate(former | rest) == request.model_validate(today | rest)
    assert set(today) <= set(request.model_json_schema()["properties"])


def test_an_option_is_called_as_its_keyword():
    odd = {f.flag: f.name for c in declared_calls().values() for f in typed_fields(c) if not f.option.is_word}
    odd = {flag: name for flag, name in odd.items() if flag != f"--{name.replace('_', '-')}"}
    assert odd == ONLY_PYTHON


def test_the_table_of_names_holds_every_option_that_two_commands_share():
    """And no other: what stands there is an option of the commands that it names."""
    used = {}
    for verb in verbs():
        for parameter in load_command(verb).params:
            if parameter.param_type_name == "option" and "--help" not in parameter.opts:
                used.setdefault(parameter.opts[-1], set()).add(verb)
    text = VOCABULARY.read_text(encoding="utf-8").partition("## One name for one thing")[2].partition("\n## ")[0]
    told = {m[1]: m[2] for m in re.finditer(r"^\| `(--[a-z-]+)[^|]*\|[^|]*\|([^|]*)\|", text, re.MULTILINE)}
    shared = {name for name, where in used.items() if len(where) > 1}
    assert shared <= told.keys()
    assert told.keys() <= used.keys()
    for name, where in told.items():
        named = set(re.findall(r"`([a-z-]+)`", where))
        assert named == used[name] or "all" in where or "every" in where, name


def test_an_option_that_two_commands_share_means_one_thing():
    kinds = {}
    for call in declared_calls().values():
        for f in typed_fields(call):
            if not f.option.is_word and f.flag not in OTHERWISE:
                kinds.setdefault(f.flag, set()).add(f.option.metavar)
    assert {flag: found for flag, found in kinds.items() if len(found) > 1} == {}
