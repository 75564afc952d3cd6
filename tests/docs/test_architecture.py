"""ARCHITECTURE.md states what is so: files that are there, and what a capability costs in lines."""

import re
from pathlib import Path

from docs.capability_lines import code_lines, rows

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "ARCHITECTURE.md").read_text()
OFF = 0.3  # by which a count may have moved until the table is written anew


def part(heading):
    return re.search(rf"## {heading}\n(.*?)\n## ", TEXT, re.DOTALL)[1]


def test_reading_begins_with_five_files_that_are_there():
    steps = re.findall(r"^(\d)\. `([^`]+)`", part("Where to begin reading"), re.MULTILINE)
    assert [number for number, _ in steps] == list("12345")
    assert all((ROOT / name).is_file() for name in re.findall(r"`(planner/[^`]+)`", part("Where to begin reading")))


def test_what_a_capability_costs_is_counted():
    stated = dict(re.findall(r"(an? \w+) (?:costs )?(\d+)[,.]", part("Where to add what").split("\n\n| ")[0]))
    counted = dict(rows())
    assert stated.keys() == counted.keys()
    for what, lines in counted.items():
        assert abs(int(stated[what]) - lines) <= OFF * lines, (what, lines)


def test_lines_of_code_are_those_without_blanks_and_comments():
    assert code_lines('"""One\n\ntwo."""\n\n# why\nx = (\n    1,  # one\n)\n') == 6


def test_every_path_that_it_names_is_there():
    for name in re.findall(r"`((?:planner|tests|docs|robots|g-code)/[\w./-]+)`", TEXT):
        assert (ROOT / name).exists(), name
