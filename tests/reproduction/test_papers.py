"""The page of the two papers: its numbers are computed, its words follow from them, its commands can be typed."""

import re
import shlex
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from planner.cli.app import load_command
from planner.reproduction.loaded_bar import fit_from_first_guess, fit_sine
from planner.reproduction.papers_result import LONG, QUICK, compute_group, page_html, page_markdown
from planner.reproduction.rows import ROWS, count_verdicts, rows_of, stored_numbers

PAGE = Path(__file__).parents[2] / "docs" / "papers.md"
MACHINE = ("processor_s",)  # numbers that another computer has otherwise
SENTENCE = re.compile(r"[^.!?;:]+(?:\.\d[^.!?;:]*)*")


@pytest.fixture(scope="module")
def rows():
    return rows_of(stored_numbers())


def test_the_page_is_made_of_the_rows_and_the_stored_numbers():
    assert PAGE.read_text() == page_markdown(stored_numbers()), "python -m docs.papers_page"


def test_every_statement_has_a_verdict_and_every_difference_a_reason(rows):
    assert len(rows) >= 100
    assert {row.paper for row in rows} == {"edbb", "trical"}
    assert count_verdicts(rows)["agrees"] > 70
    assert [row for row in rows if row.verdict == "differs" and not row.why] == []


def test_each_paper_has_all_its_tables_figures_and_equations(rows):
    for paper, tables, figures, equations in (("edbb", 2, 15, 9), ("trical", 9, 9, 13)):
        where = " ".join(row.where for row in rows if row.paper == paper)
        ranges = re.compile(r"(\d+)(?: to | and )(\d+)")
        where = ranges.sub(lambda m: " ".join(map(str, range(int(m[1]), int(m[2]) + 1))), where)
        numbers = set(re.findall(r"\d+", where))
        assert {str(k) for k in range(1, tables + 1)} <= numbers
        assert {str(k) for k in range(1, equations + 1)} <= numbers
        assert {str(k) for k in range(1, figures + 1)} <= numbers


def test_the_commands_can_be_typed(rows):
    for command in {row.command for row in rows if row.command}:
        edbb, verb, *rest = shlex.split(command)
        assert edbb == "edbb"
        load_command(verb).make_context(verb, rest)


def test_sentences_are_short(rows):
    long = [s for row in rows for text in (row.says, row.ours, row.why) for s in SENTENCE.findall(text)
            if len(s.split()) > 25]  # fmt: skip
    assert long == []


def test_a_verdict_follows_from_its_number():
    changed = deepcopy(stored_numbers())
    changed["plan"]["knee"] = 80
    (row,) = (r for r in rows_of(changed) if "optimum near 35" in r.says)
    assert row.verdict == "differs"
    assert "80 poses" in row.ours


def test_the_page_of_the_command_shows_every_row(rows):
    text = page_html(stored_numbers(), {})
    assert text.count('class="verdict') == len(rows)


def assert_alike(found, stored, rel, where):
    """Numbers within ``rel`` of each other, texts and counts the same."""
    if isinstance(stored, dict):
        assert found.keys() == stored.keys(), where
        for key in stored.keys() - set(MACHINE):
            assert_alike(found[key], stored[key], rel, f"{where}.{key}")
    elif isinstance(stored, list):
        assert len(found) == len(stored), where
        for a, b in zip(found, stored, strict=True):
            assert_alike(a, b, rel, where)
    elif isinstance(stored, float):
        assert found == pytest.approx(stored, rel=rel, abs=1e-6), where
    else:
        assert found == stored, where


@pytest.mark.parametrize("group", QUICK)
def test_what_takes_seconds_is_computed_as_stored(group):
    assert_alike(dict(compute_group(group)), stored_numbers()[group], 1e-3, group)


@pytest.mark.long
@pytest.mark.parametrize("group", [name for name in LONG if name != "methods"])
def test_verdicts_hold_when_all_is_computed_anew(group, rows):
    numbers = {**stored_numbers(), group: compute_group(group)}
    assert [row.verdict for row in rows_of(numbers)] == [row.verdict for row in rows]


def test_a_free_frequency_is_found_wherever_the_guess_lies():
    theta = np.linspace(0.0, 2 * np.pi, 400)
    y = 0.764e-3 * np.sin(0.933 * theta - np.radians(14.08))
    a, b, phase, rms = fit_sine(theta, y)
    np.testing.assert_allclose([a * 1e3, b, np.degrees(phase)], [0.764, 0.933, 14.08], rtol=1e-4)
    assert rms < 1e-8
    np.testing.assert_allclose(fit_from_first_guess(theta, y), [a, b, phase], rtol=1e-4)


def test_a_row_has_a_verdict_or_numbers(tmp_path, monkeypatch):
    text = ROWS.read_text()
    broken = tmp_path / "rows.toml"
    broken.write_text(text.replace('verdict = "agrees"\n', "", 1))
    monkeypatch.setattr("planner.reproduction.rows.ROWS", broken)
    with pytest.raises(ValueError, match="needs either 'verdict' or 'within'"):
        rows_of(stored_numbers())
