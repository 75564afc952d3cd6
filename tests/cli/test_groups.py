"""The list of commands is grouped as the documentation groups them, and no command is lost."""

import re
from pathlib import Path

from planner.cli.app import command_groups, verbs
from planner.common.calls import GROUPS, MORE, Call
from tests.command import edbb

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"


def test_the_documentation_has_the_same_groups():
    parts = re.split(r"(?m)^## (\w+)$", PAGE.read_text())[1:]
    for heading, text in zip(parts[::2], parts[1::2], strict=True):
        shown = re.findall(r"\[`edbb ([a-z-]+)`\]", text)
        assert shown
        assert {command_groups()[name] for name in shown} == {heading}
    assert command_groups().keys() == verbs().keys()
    assert Call.group == MORE  # of an extension that does not say


def test_the_help_shows_every_command_under_its_group():
    shown = edbb("--help").stdout
    at = {heading: shown.index(f"─ {heading} ─") for heading in GROUPS}
    assert list(at.values()) == sorted(at.values())
    for name in verbs():
        where = re.search(rf"│ {name} ", shown)
        assert where, name
        assert max((h for h in at if at[h] < where.start()), key=at.get) == command_groups()[name]
