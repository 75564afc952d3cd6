"""What the KUKA tutorial says of mounting and reading the bar is what cell, program, checklist and ``measure`` do."""

import re
from dataclasses import replace
from itertools import pairwise

import pytest

from planner.cell.reading import gauge_class, load_cell
from planner.centring.live_session import MeasuringSession, open_log, program_remark
from planner.session.neutral_program import driven_form, session_program, write_programs, write_session
from planner.session.planned_session import load_session
from tests.docs.test_pages import PAGES, ROOT

PAGE = PAGES["docs/tutorials/kuka-bar.md"]


@pytest.fixture(scope="module")
def cell():
    return load_cell("kuka-kr6-r700/edbb")


@pytest.fixture(scope="module")
def session():
    """A plan of 42 poses for this arm and bar, from before a cell said how the bar is read; 40 is a mount pose."""
    return load_session(ROOT / "tests" / "data" / "kr6-plan" / "plan.json", "written")


@pytest.fixture(scope="module")
def program(cell, session):
    neutral = session_program(cell, session.courses, session.document.plan_id, driven_form("krl"))
    return write_session(cell, neutral, "krl", "mine")[0].text


@pytest.mark.slow
def test_the_program_stops_at_every_pose_and_names_it_as_the_page_says(program, session):
    assert "At each pose it stops again. The line above the `HALT` names the pose" in PAGE
    (shown,) = re.findall(r"\*(pose \d+ of \d+: [^*]+)\*", PAGE)
    pattern = "; " + re.sub(r"\d+ of \d+", r"(\\d+) of 43", shown)
    lines = [line.strip() for line in program.splitlines()]
    stops = [k for k, line in enumerate(lines) if line == "HALT"]
    named = [re.fullmatch(pattern, lines[k - 1]) for k in stops]
    assert [int(m[1]) for m in named[1:-1]] == [p.id for p in session.document.poses if p.role != "mount"]
    assert len(stops) == 2 + 42
    assert "attach the bar" in lines[stops[0] - 1]
    assert "take the bar off" in lines[stops[-1] - 1]
    moves = [k for k, line in enumerate(lines) if line.startswith("PTP")]
    for a, b in pairwise(stops):
        assert any(a < k < b for k in moves), "it moves from one reading to the next"


def test_the_bar_that_a_person_reads_needs_no_wire(program):
    assert not re.search(r"\$(IN|OUT)\[", program)
    head = " ".join(re.findall(r"^; (.*)$", program.replace("\r", ""), re.MULTILINE))
    assert "cell names no controller.gauge_input" in head
    assert "waits until input" not in head


@pytest.mark.slow
def test_the_program_has_the_name_that_the_page_says(cell, session):
    neutral = session_program(cell, session.courses, session.document.plan_id, driven_form("krl"))
    ((_, files),) = write_programs(replace(cell, name="cell"), {"krl": neutral})
    assert "KUKA_KR6_R700_CELL.dat" in {f.name for f in files}
    assert "edbb plan cell.toml -o mine --dialect krl" in PAGE
    assert "edbb import KUKA_KR6_R700_CELL.dat gauge.csv" in PAGE


def test_the_old_plan_keeps_its_program(session):
    """A cell without the word: the robot stands still and drives on, as it did, and its head says so."""
    neutral = session_program(session.cell, session.courses, session.document.plan_id, driven_form("krl"))
    text = write_session(session.cell, neutral, "krl", "old")[0].text
    assert text.count("HALT") == 2
    assert "drives on by itself" in " ".join(line.strip("; ") for line in text.splitlines())


def test_measure_asks_for_the_poses_by_the_numbers_of_the_pendant(program, session, tmp_path):
    asked = []

    def ask(text):
        asked.append(text)
        return "s" if text.startswith("pose") else "q"

    log = open_log(tmp_path / "run.csv", session.document, session.cell)
    list(MeasuringSession(log, ask, iter(range(1000)).__next__).run())
    at_pendant = re.findall(r"^; (pose \d+ of \d+): read the gauge", program, re.MULTILINE)
    assert [text.partition(" at ")[0] for text in asked[:-1]] == at_pendant
    assert "by the same number" in program_remark("hand")
    assert re.search(r"the same\s+poses by the same numbers", PAGE.replace("for the same poses", "the same poses"))


def test_the_numbers_of_the_page_are_those_of_cell_and_checklist(cell):
    guide = gauge_class(cell.file).session_guide(cell.file)
    (before,), (attach,) = guide.before, guide.at_start
    for place in ("[30, 0, 110] mm", "[430, 330, 60] mm"):
        assert place in PAGE
        assert place in before.text
    tool, fixture, gauge = cell.file.tool, cell.file.fixtures[0], cell.file.gauge
    assert (tool.map_mm, fixture.position_mm) == ((30, 0, 110), (430, 330, 60))
    assert "300 to 520 mm between the centres of its" in PAGE
    assert "reads 300 to 520 mm between the centres of its two balls; the middle of its range is 410 mm" in before.text
    assert gauge.length_mm == (300, 520)
    assert "110 mm out of the flange and 30 mm beside its axis" in before.text
    assert "within 10 mm is\n   near enough" in PAGE
    assert "Within 10 mm is near enough" in before.text
    assert "Set its display to the length" in attach.text
    assert "Do not set it again before the last pose" in attach.text
    assert gauge.read_by == "hand"
    assert "counts 20 s for each reading" in cell.gauge.reading_text(cell.file)
    assert "The plan counts 20 s for each reading (`reading_s`)" in PAGE
    assert cell.with_reading_time().rest_seconds == pytest.approx(0.5 + 20.0)  # at rest, then the person
