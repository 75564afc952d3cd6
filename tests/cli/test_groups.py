"""The list of commands is grouped as the documentation groups them, and no command is lost."""

import re
from pathlib import Path

from planner.cli.app import VERBS
from planner.cli.command_groups import GROUPS, MORE, group_of, in_order
from tests.command import edbb

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"


def test_the_documentation_has_the_same_groups():
    parts = re.split(r"(?m)^## (\w+)$", PAGE.read_text())[1:]
    for heading, text in zip(parts[::2], parts[1::2], strict=True):
        shown = re.findall(r"\[`edbb ([a-z-]+)`\]", text)
        assert shown
        assert {group_of(name) for name in shown} == {heading}
    assert {name for names in GROUPS.values() for name in names} <= VERBS.keys()
    assert sorted(in_order(list(VERBS))) == sorted(VERBS)
    assert group_of("of-an-extension") == MORE


def test_the_help_shows_every_command_under_its_group():
    shown = edbb("--help").stdout
    at = {heading: shown.index(f"─ {heading} ─") for heading in (*GROUPS, MORE)}
    assert list(at.values()) == sorted(at.values())
    for name in VERBS:
        where = re.search(rf"│ {name} ", shown)
        assert where, name
        assert max((h for h in at if at[h] < where.start()), key=at.get) == group_of(name)
