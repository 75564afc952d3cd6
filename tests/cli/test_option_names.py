"""One thing has one name."""

import re
from collections import Counter
from pathlib import Path

import planner
from planner.cli.app import load_command, verbs
from planner.common.calls import typed_fields
from planner.workflow.verbs import declared_calls

VOCABULARY = Path(planner.__file__).parents[1] / "docs/commands.md"
ONLY_PYTHON = {"--map": "map_file"}  # "map" is a function of Python
OTHERWISE = {"--places", "--unloaded"}  # what each command means by it stands in the table


def test_an_option_is_called_as_its_keyword():
    odd = {f.flag: f.name for c in declared_calls().values() for f in typed_fields(c) if not f.option.is_word}
    odd = {flag: name for flag, name in odd.items() if flag != f"--{name.replace('_', '-')}"}
    assert odd == ONLY_PYTHON


def test_the_table_of_names_holds_every_option_that_two_commands_share():
    """And no other."""
    used = Counter(
        parameter.opts[-1]
        for verb in verbs()
        for parameter in load_command(verb).params
        if parameter.param_type_name == "option" and "--help" not in parameter.opts
    )
    text = VOCABULARY.read_text(encoding="utf-8").partition("## One name for one thing")[2].partition("\n## ")[0]
    named = set(re.findall(r"^\| `(--[a-z-]+)", text, re.MULTILINE))
    assert {name for name, commands in used.items() if commands > 1} <= named
    assert named <= used.keys()


def test_an_option_that_two_commands_share_means_one_thing():
    kinds = {}
    for call in declared_calls().values():
        for f in typed_fields(call):
            if not f.option.is_word and f.flag not in OTHERWISE:
                kinds.setdefault(f.flag, set()).add(f.option.metavar)
    assert {flag: found for flag, found in kinds.items() if len(found) > 1} == {}
