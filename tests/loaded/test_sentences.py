"""What is said of compliances: no value where nothing was learnt, percentages that can be read, no plain µ missing."""

import numpy as np
import pytest

from planner.loaded.compliance import compliance_posterior
from planner.loaded.results import compliance_sentences, compliance_text, share_text
from planner.loaded.types import HARDLY_KNOWN, KNOWN, NOT_LEARNT
from planner.programs.rendering import ProgramFile
from planner.workflow.plan_results import plan_files

NAMES = tuple(f"compliance{i + 1}" for i in range(4))


def files_of(names):
    return plan_files((("krl", tuple(ProgramFile(name, "") for name in names)),))


@pytest.fixture
def found():
    """Readings that alone would know the four to 1 %, 50 %, 146 % and nothing of their prior sigma."""
    prior, alone = np.full(4, 2e-6), np.array([0.01, 0.5, 1.46, 1e7])
    information = np.diag((alone * prior) ** -2.0)
    return compliance_posterior(NAMES, prior, information, information @ np.full(4, 1e-6), 1e-6, 1.0)


def test_each_is_told_by_what_the_readings_add(found):
    assert found.verdicts == (KNOWN, HARDLY_KNOWN, NOT_LEARNT, NOT_LEARNT)
    assert [c.verdict for c in found.combinations] == [KNOWN, HARDLY_KNOWN, NOT_LEARNT, NOT_LEARNT]


def test_nothing_learnt_has_no_value(found):
    assert compliance_text(found, 0) == "1.000 ± 0.020 µrad/Nm"
    assert "hardly known: before ± 2" in compliance_text(found, 1)
    assert compliance_text(found, 2) == "nothing learnt: before ± 2, with this run ± 1.65 µrad/Nm"


def test_sentences_name_what_is_open_and_what_would_help(found):
    first, hardly, more, last = compliance_sentences(found, 1)
    assert first.startswith("The circle knows 1 of 4 combinations")
    assert "the ± 2 µrad/Nm that was expected before, or better: c1 to 1 % of it." in first
    assert hardly == "Hardly better known than before: c2 to 50 % of it."
    assert "of c3 (1.5 times as uncertain as before); c4 (many thousand times as uncertain as before)" in more
    assert last.startswith("So nothing is learnt of compliance3 and compliance4; circles at other places")
    assert "circles together know" in compliance_sentences(found, 3)[0]


@pytest.mark.parametrize(("part", "text"), [(0.0015, "0.15 %"), (0.0951, "10 %"), (1.46, "146 %"), (25.0, "25 times")])
def test_parts_are_written_without_exponents(part, text):
    assert share_text(part) == text


def test_parts_of_a_program_are_listed_in_one_go():
    names = ["a.mod", "X.src", *(f"X_{k:03d}.src" for k in range(1, 30)), "X.dat"]
    line = files_of(names)
    assert line == "a.mod, X.src, X_001.src … 029.src, X.dat, plan.json, cell.toml, trajectory.csv, report.html"
    assert "X_001.src, X_002.src, X.dat" in files_of(["X_001.src", "X_002.src", "X.dat"])
