"""Which long tests a run of CI takes, and that each has its turn."""

import sys
from pathlib import Path

import pytest

from tests.long_runs import ORDER, RUNS, LongRun, failed_files, in_order, rooms_below, run_within, updated, within

MANY = [LongRun(f"tests/{room}/test_{k}.py", f"2026-01-0{1 + k}", "", "60") for room in ORDER for k in range(5)]


@pytest.mark.slow
def test_what_waited_longest_is_first_then_the_room_that_changed_then_those_above():
    order = in_order(MANY, {"tracing"}, "a commit")
    due = order[: len(MANY) // RUNS + 1]
    assert {r.date for r in due} == {"2026-01-01"}
    rest = [r.room for r in order if r not in due]
    last = max(k for k, room in enumerate(rest) if room == "tracing")
    assert set(rest[: last + 1]) == {"tracing"}
    above = [k for k, room in enumerate(rest) if "tracing" in rooms_below(room)]
    assert above == list(range(len(above)))
    assert "motion" in rest[len(above) :]


def test_each_has_its_turn_within_ten_runs():
    """However much of the rooms that change, a tenth that waited longest goes before it."""
    table = [LongRun(r.file, "", "", r.seconds) for r in MANY]
    seen = set()
    for run in range(RUNS):
        order = in_order(table, {"cli"}, f"commit {run}")
        taken = {r.file for r in within(order, 60 * (len(MANY) // RUNS + 1))}
        seen |= taken
        table = [LongRun(r.file, f"2026-02-{run + 1:02}", "", "60") if r.file in taken else r for r in table]
    assert seen == {r.file for r in MANY}


def test_a_change_of_the_ground_concerns_every_room():
    assert all("common" in rooms_below(room) for room in ORDER if room != "wings")
    assert "identification" not in rooms_below("motion")


def test_only_files_that_passed_whole_are_dated(tmp_path):
    report = tmp_path / "report.xml"
    cases = {"good": ("",), "bad": ("", "<failure/>"), "late": ('<skipped message="no time was left for it"/>',)}
    text = "".join(
        f'<testcase file="tests/cli/test_{name}.py" time="7.5">{inside}</testcase>'
        for name, many in cases.items()
        for inside in many
    )
    report.write_text(f"<testsuites><testsuite>{text}</testsuite></testsuites>")
    rows = updated([LongRun(f"tests/cli/test_{name}.py") for name in (*cases, "other")], report, "abc")
    assert {Path(r.file).stem: r.seconds for r in rows if r.commit == "abc"} == {"test_good": "8"}


@pytest.mark.parametrize("seconds", [1.0, 240.0])
def test_as_many_as_the_time_holds(seconds):
    assert len(within(MANY, seconds)) == max(1, seconds // 60)


@pytest.mark.posix
def test_what_still_runs_when_the_time_is_over_is_interrupted():
    assert run_within([sys.executable, "-c", "import time; time.sleep(600)"], 0.5)[1]
    assert run_within([sys.executable, "-c", "raise SystemExit(3)"], 600.0) == (3, False)


def test_files_that_failed_are_those_of_the_report(tmp_path):
    report = tmp_path / "report.xml"
    report.write_text(
        '<testsuites><testsuite><testcase file="a.py" time="1"/><testcase file="b.py" time="1"><failure/></testcase>'
        '<testcase file="c.py" time="1"><error/></testcase></testsuite></testsuites>'
    )
    assert failed_files(report) == {"b.py", "c.py"}
