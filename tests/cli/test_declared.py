"""A new option stands in one place, the declaration of its verb: it is seen wherever a verb is called or described."""

import importlib.util
import inspect
import re
import subprocess
import sys
from dataclasses import KW_ONLY, dataclass, make_dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest
import typer
from typer.testing import CliRunner

import planner
from planner.cell.declared import CellWord
from planner.cell.file import MotionFile
from planner.cell.reading import load_cell
from planner.cli.app import with_shared_options
from planner.cli.declared import folder_command
from planner.common.calls import Call, Option, ProgressKeyword, call_fields, called_with, options_table
from planner.common.errors import DeclarationError
from planner.common.progress import no_progress
from planner.common.result import Result
from planner.common.summary import Summary
from planner.effects.catalogue import effect_kinds
from planner.service.declared_request import take_fields
from planner.service.job_folder import JobFolder
from planner.service.job_request import CellRequest
from planner.service.pages import ENVIRONMENT
from planner.session.options import PlanOptions, motion_keys
from planner.workflow.verbs import declared_calls

ROOT = Path(planner.__file__).parents[1]


@dataclass(frozen=True)
class WarmCall(Call):
    """Warm a robot up."""

    verb = "warm"
    line = "Warm a robot up."
    function = f"{__name__}:warm"

    cell: CellWord
    _: KW_ONLY
    laps: Annotated[int, Option("times that the way is driven", min=1, max=50)] = 3
    pace: Annotated[Literal["slow", "fast"] | None, Option("how quickly")] = None
    progress: ProgressKeyword = no_progress


class Warmed(Result):
    def __init__(self, asked):
        self.asked = asked

    def overview(self):
        return Summary(f"{self.asked.cell}: {self.asked.laps} laps, {self.asked.pace}")

    def content(self):
        return {"laps": self.asked.laps, "pace": self.asked.pace}

    def write(self, folder, force=False):
        Path(folder).mkdir()
        return []


@called_with(WarmCall)
def warm(asked: WarmCall) -> Warmed:
    """Warm a robot up.

    Raises:
        InputError: never.
    """
    return Warmed(asked)


def test_it_is_in_the_signature_of_the_function_and_in_its_docstring():
    laps = inspect.signature(warm).parameters["laps"]
    assert (laps.kind, laps.default, laps.annotation) == (inspect.Parameter.KEYWORD_ONLY, 3, int)
    assert "    laps: times that the way is driven.\n" in warm.__doc__
    assert warm.__doc__.index("Args:") < warm.__doc__.index("Raises:")
    assert warm("ur10/edbb", laps=7).asked.laps == warm(cell="ur10/edbb", laps=7).asked.laps == 7


def test_the_documentation_sees_the_signature_and_not_what_is_behind_it():
    assert inspect.unwrap(planner.plan) is planner.plan
    assert list(inspect.signature(planner.plan).parameters)[:3] == ["cell", "poses", "index"]


def test_what_is_not_declared_is_refused_by_the_name_of_the_function():
    with pytest.raises(TypeError, match=r"warm\(\): got an unexpected keyword argument 'rounds'"):
        warm("ur10/edbb", rounds=1)  # type: ignore[call-arg]  # what is tested
    with pytest.raises(TypeError, match=r"warm\(\): missing a required argument: 'cell'"):
        warm()  # type: ignore[call-arg]  # what is tested


@pytest.mark.long
def test_a_type_checker_knows_the_keywords(tmp_path):
    """Of a declared function: the right call passes, a wrong name and a wrong type do not."""
    calls = 'from planner import plan\nplan("x", poses=3)\nplan("x", pose=3)\nplan("x", poses="3")\n'
    (tmp_path / "calls.py").write_text(calls)
    words = ["-m", "mypy", "--follow-imports=silent", "--cache-dir", ROOT / ".mypy_cache", tmp_path / "calls.py"]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False, cwd=ROOT)
    found = re.findall(r"calls\.py:(\d+): error: (.*?)  \[", done.stdout)
    assert [line for line, _ in found] == ["3", "4"], done.stdout
    assert "pose" in found[0][1]
    assert "int" in found[1][1]


@pytest.fixture
def command():
    app = typer.Typer(add_completion=False)
    app.command("warm")(with_shared_options(folder_command(WarmCall)))
    return lambda *words: CliRunner().invoke(app, [str(w) for w in words], env={"COLUMNS": "120"})


def test_it_is_on_the_command_line_and_in_its_help(command, tmp_path):
    text = re.sub(r"\x1b\[[0-9;]*m", "", command("--help").output)
    assert re.search(r"--laps .*1<=x<=50.*times that the way is driven", text)
    done = command("ur10/edbb", "-o", tmp_path / "out", "--laps", 5, "--pace", "slow", "--json")
    assert done.stdout == '{\n "laps": 5,\n "pace": "slow"\n}\n'
    assert command("ur10/edbb", "-o", tmp_path / "more", "--laps", 51).exit_code == 2


def test_it_is_in_the_request_its_schema_and_the_words_of_the_command():
    @take_fields(WarmCall)
    class WarmRequest(CellRequest):
        kind = "warming"
        example = {"cell": "ur10/edbb"}

    schema = WarmRequest.model_json_schema()["properties"]["laps"]
    assert schema.items() >= {"minimum": 1, "maximum": 50, "default": 3, "type": "integer"}.items()
    assert schema["description"] == "times that the way is driven"
    request = WarmRequest.model_validate({"cell": "ur10/edbb", "laps": 4})
    words = request.command(JobFolder(None, None, None)).words
    assert " ".join(words) == "warm ur10/edbb -o out --json --laps 4"
    with pytest.raises(ValueError, match="less than or equal to 50"):
        WarmRequest.model_validate({"cell": "ur10/edbb", "laps": 51})


def test_it_is_in_the_form(monkeypatch):
    monkeypatch.setitem(declared_calls(), "warm", WarmCall)
    page = '{% from "options.html.j2" import option_inputs %}{{ option_inputs(typed_options("warm")) }}'
    html = ENVIRONMENT.from_string(page).render()
    laps = re.search(r'<input id="option-laps"[^>]*>', html)[0]
    assert all(part in laps for part in ('data-option="laps"', 'type="number"', 'min="1"', 'max="50"', 'value="3"'))
    assert re.findall(r'<option value="(\w*)"', html) == ["", "slow", "fast"]


def test_it_is_in_the_table_of_the_documentation():
    row = "| `--laps` | 1 to 50, default 3 | times that the way is driven |"
    assert row in options_table(WarmCall).splitlines()
    spec = importlib.util.spec_from_file_location("options_tables", ROOT / "docs" / "options_tables.py")
    hook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hook)
    for call in declared_calls().values():
        page = hook.on_page_markdown((ROOT / "docs" / "commands" / f"{call.verb}.md").read_text(), page=None)
        assert options_table(call) in page
        assert "<!--" not in page
    causes = hook.on_page_markdown((ROOT / "docs" / "effects.md").read_text(), page=None)
    assert "\n| poses that excite it | joint compliance, " in causes
    assert '| a run measured while moving (motion.measure = "continuous") | hysteresis, servo lag' in causes
    table = [row.strip("| ").split(" | ") for row in causes.partition("\n## ")[0].splitlines() if row.startswith("| ")]
    assert sorted(kind for row in table[1:] for kind in row[1].split(", ")) == sorted(effect_kinds())


def test_every_motion_key_is_a_key_of_the_cells_motion():
    assert "order" in motion_keys(PlanOptions, MotionFile)


def test_a_motion_key_that_no_cell_has_is_refused():
    option = Option("how near", motion_key=True)
    wrong = make_dataclass("Mine", [("clearence_mm", Annotated[float | None, option], None)], bases=(PlanOptions,),
                           frozen=True, kw_only=True)  # fmt: skip
    said = r'Mine\.clearence_mm: motion_key=True, but \[motion\] .* did you mean "clearance_mm"\? \(there: measure, '
    with pytest.raises(DeclarationError, match=said):
        wrong().in_motion(load_cell("ur10/edbb"))


@pytest.mark.parametrize("call", declared_calls().values(), ids=lambda call: call.verb)
def test_every_declaration_is_whole(call):
    """Each field has an option, but the progress; the function of the verb takes what is declared."""
    assert [f.name for f in call_fields(call) if f.option is None] in ([], ["progress"])
    assert call.line
    assert inspect.getdoc(call)
    module, name = call.function.split(":")
    function = getattr(importlib.import_module(module), name)
    assert list(inspect.signature(function).parameters) == [f.name for f in call_fields(call)]
