"""What the screen says: one fact a line in one column, notes that ask nothing only where more is asked."""

import dataclasses
import re

import pytest

from planner.common.summary import (
    KEY,
    Aside,
    Summary,
    count_alike,
    cut_facts,
    fact_lines,
    hang_lines,
    name_first,
    under_key,
)


def said(verbose=False):
    notes = ("mount the bar anew", Aside("3 poses were replaced"), *(f"pose {k} is near a stop" for k in range(10)))
    facts = [("drive", "41 min"), *under_key("zeros", ["joint 1", "joint 2"])]
    return Summary("robot: done", facts, [("proof", "gap 0.1 %")], notes).text(verbose)


def test_every_fact_is_one_line_in_one_column():
    first, *lines = said(verbose=True).splitlines()
    assert first == "robot: done"
    assert [line[2 : 2 + KEY].strip() for line in lines] == ["drive", "zeros", "", *["note"] * 2, "proof", "aside"]
    assert all(line[:2] == "  " and line[2 + KEY] != " " for line in lines)


def test_details_and_what_asks_nothing_are_said_where_more_is_asked():
    assert "proof" not in said()
    assert "replaced" not in said()
    assert set(said().splitlines()) < set(said(verbose=True).splitlines())


def test_the_same_note_many_times_is_one_with_its_count():
    alike = [line for line in said().splitlines() if "near a stop" in line]
    assert len(alike) == 1
    assert re.search(r"pose 0 is near a stop \(and 9 more like it\)$", alike[0])
    assert count_alike(["a 1", "b 1", "a 2.5"]) == ["a 1 (and 1 more like it)", "b 1"]


def test_files_with_the_same_note_are_named():
    notes = [f"images/pose_{k}.png: is blurred, {k + 5.5} px; left out" for k in (3, 4, 7)]
    assert count_alike(notes) == [f"{notes[0]} (and 2 more like it: pose_4.png, pose_7.png)"]
    rows = [f"run.csv: row {k} has no reading" for k in (3, 4)]
    assert count_alike(rows) == [f"{rows[0]} (and 1 more like it)"]


def test_a_long_fact_goes_on_below_itself_and_a_command_stays_whole():
    words = " ".join(f"word{k}" for k in range(30))
    text = "\n".join(["robot: " + words, *fact_lines([("misfit", words), ("next", f"edbb plan {words}")])])
    title, first, *more, command = hang_lines(text, 60).split("\n")
    assert title == "robot: " + words
    assert first.startswith("  misfit      word0")
    assert all(line.startswith(" " * (KEY + 2) + "word") for line in more)
    assert all(len(line) <= 60 for line in (first, *more))
    assert " ".join((first, *(line.strip() for line in more))) == f"  misfit      {words}"
    assert command == f"  next        edbb plan {words}"


def test_of_many_names_the_first_are_said_and_how_many_more_there_are():
    names = [f"x{k}" for k in range(20)]
    assert name_first(names[:9]) == ", ".join(names[:9])  # never "and 1 more"
    assert name_first(names) == ", ".join(names[:8]) + " and 12 more"


@pytest.mark.parametrize("most", [3, 5, 6, 8, 10])
@pytest.mark.parametrize("notes", [0, 1, 3, 30])
@pytest.mark.parametrize("facts", [0, 2, 5, 40])
def test_a_screen_has_a_limit_of_lines_and_says_how_much_is_left_out(facts, notes, most):
    words = "abcdefghijklmnopqrstuvwxyzäöüßåæøœαβγδεζηθ"  # notes that differ in more than numbers
    summary = Summary(
        "done", [(f"f{k}", "said") for k in range(facts)], (), [f"warned {words[k]}" for k in range(notes)]
    )
    lines = summary.text(most=most).splitlines()
    assert len(lines) <= most
    told = sum(int(n) for line in lines for n in re.findall(r"\(and (\d+) more lines?: -v\)", line))
    assert len(lines) - 1 + told == facts + notes
    assert len([line for line in lines if line.startswith("  f")]) >= min(facts, 4, most - 2)
    if notes:
        assert any("note" in line for line in lines)
    assert len(summary.text(verbose=True, most=most).splitlines()) == 1 + facts + notes


def test_what_is_cut_is_counted_at_the_last_that_is_said():
    facts = [("a", "1"), ("b", "2"), ("c", "3")]
    assert cut_facts(facts, 3) == facts
    assert cut_facts(facts, 2) == [("a", "1"), ("b", "2 (and 1 more line: -v)")]


@pytest.mark.parametrize("most", [4, 6, 10])
@pytest.mark.parametrize("notes", [0, 1, 30])
def test_what_stays_is_said_however_few_lines_there_are(notes, most):
    facts = [(f"f{k}", "said") for k in range(9)]
    words = "abcdefghijklmnopqrstuvwxyzäöüßåæ"
    plain = Summary("done", facts, (), [f"warned {words[k]}" for k in range(notes)])
    for stays in facts:
        lines = dataclasses.replace(plain, stays=stays).text(most=most).splitlines()
        keys = [line.split()[0] for line in lines[1:]]
        assert stays[0] in keys
        assert len(lines) == len(plain.text(most=most).splitlines()) <= most
        shown = [key for key in keys if key != "note"]
        assert shown == sorted(shown)  # in their order
        told = sum(int(n) for line in lines for n in re.findall(r"\(and (\d+) more lines?: -v\)", line))
        assert len(lines) - 1 + told == len(facts) + notes
