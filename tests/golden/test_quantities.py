"""The record: what the comparison must see and pass over, and the cases themselves, the quick ones by default."""

from dataclasses import replace

import pytest

from tests.golden.__main__ import TABLE
from tests.golden.case import run
from tests.golden.cases import CASES
from tests.golden.quantity import Quantity, changes, read_table, renewed, write_table

DRIVE = Quantity("arm", "drive", 12.0, "min", "5 %", "less")
POSES = Quantity("arm", "poses", 40.0, "", "0")
QUICK = {"import"}


@pytest.mark.parametrize(
    ("kept", "value", "verdict"),
    [
        (DRIVE, 12.5, "within"),
        (DRIVE, 12.7, "worse"),
        (DRIVE, 11.0, "better"),
        (replace(DRIVE, better="more"), 12.7, "better"),
        (replace(DRIVE, better=""), 12.7, "moved"),
        (replace(DRIVE, tolerance="0.5"), 12.7, "worse"),
        (replace(DRIVE, tolerance="0.8"), 12.7, "within"),
        (replace(DRIVE, value=0.0, tolerance="5 %"), 1e-9, "worse"),
        (POSES, 41.0, "moved"),
        (POSES, 40.0, "within"),
    ],
)
def test_a_move_is_judged_by_the_tolerance_of_its_quantity(kept, value, verdict):
    (only,) = changes([kept], [replace(kept, value=value)])
    assert (only.verdict, only.outside) == (verdict, verdict != "within")


def test_no_number_is_no_value_within():
    (only,) = changes([DRIVE], [replace(DRIVE, value=float("nan"))])
    assert only.outside


def test_what_is_new_missing_or_in_another_unit_is_seen():
    found = [replace(DRIVE, unit="s"), replace(POSES, name="fixtures")]
    assert [c.verdict for c in changes([DRIVE, POSES], found)] == ["moved", "new", "missing"]


def test_a_move_says_its_size_direction_and_tolerance():
    (only,) = changes([DRIVE], [replace(DRIVE, value=13.2)])
    assert only.text == "worse   arm, drive: 12 -> 13.2 min, +1.2 (+10 %), tolerance 5 %"


def test_small_steps_add_up_until_they_are_seen():
    table = [DRIVE]
    for value in (12.4, 12.5):
        table = renewed(table, [replace(DRIVE, value=value)])
    assert table == [DRIVE]
    (only,) = renewed(table, [replace(DRIVE, value=13.0, tolerance="1 %")])
    assert only == replace(DRIVE, value=13.0)  # the table's tolerance stays


def test_the_table_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "table.csv"
    write_table(path, [POSES, DRIVE])
    assert read_table(path) == [DRIVE, POSES]
    assert path.read_text().splitlines()[1] == "arm,drive,12,min,5 %,less"


def test_the_table_is_of_these_cases_alone():
    silent = {"lists", "refused"}  # facts and exit codes, no quantity
    assert {q.case for q in read_table(TABLE)} <= {c.name for c in CASES} - silent


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=() if c.name in QUICK else pytest.mark.long, id=c.name) for c in CASES]
)
def test_a_case_moves_no_quantity(case):
    found, problems = run(case)
    assert not problems
    moved = [c.text for c in changes([q for q in read_table(TABLE) if q.case == case.name], found) if c.outside]
    assert not moved, "\n".join(moved)
