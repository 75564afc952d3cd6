import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.design.expected_errors import ErrorByNumber, ErrorForecast
from planner.design.observability.information import INDEX_RULES
from planner.design.target_errors import TargetForecast
from planner.report.mounting import mounting_drawings, mounting_steps
from planner.report.plan_report import report_plan
from planner.runs.run import FIRST_MOUNTING, Mounting
from planner.session.plan_types import Plan
from planner.session.plan_verdict import judge_plan
from tests.report.made import FIXTURE, NOTE, PLAN_ID
from tests.report.reading import ReadPage


@pytest.mark.slow
def test_page_loads_nothing_from_elsewhere(page: ReadPage) -> None:
    assert all(load.startswith("data:") for load in page.loads)
    assert "@import" not in page.styles
    assert "url(" not in page.styles
    ours = [text for a, text in page.scripts if a.get("type") in (None, "module")]
    assert not [text for text in ours if re.search(r"fetch\(|XMLHttpRequest|https?:", text)]


def test_page_stays_small_enough_to_send(folder: Path) -> None:
    assert (folder / "report.html").stat().st_size < 1_500_000


@pytest.mark.slow
def test_same_plan_gives_same_bytes(plan: Plan, folder: Path) -> None:
    assert report_plan(plan).html() == (folder / "report.html").read_text(encoding="utf-8")
    assert [p.name for p in folder.iterdir()] == ["report.html"]


def test_page_names_no_place_of_this_machine(plan: Plan, page: ReadPage) -> None:
    own = "".join(text for _, text in page.scripts) + page.text
    for place in (plan.cell.path, plan.cell.robot.path, Path.home()):
        assert str(place.resolve()) not in own


def test_every_chart_has_its_place(page: ReadPage) -> None:
    assert {"view", "index_curve", "funnel", "parameters", "tour", "joints", "bar", "speeds"} <= page.ids


def test_steps_say_what_to_screw_where_and_which_length_to_set(plan: Plan) -> None:
    steps, (drawing,) = mounting_steps(plan), mounting_drawings(plan)
    assert "[258, 1468, 708] mm of the base" in steps[0]
    assert "[50, 0, 150] mm of the flange" in steps[1]
    length = plan.drives[0].visits[0].length
    assert f"to 1 mm: about {1e3 * length:.1f} mm. Set its display to that length." in steps[2]
    assert drawing.holder == "ball at [50, 0, 150] mm of the flange"
    assert drawing.position == (258, 1468, 708)
    assert drawing.away == pytest.approx(np.hypot(258, 1468))
    scale = (drawing.fixture[0] - drawing.base[0]) / drawing.away
    assert (drawing.floor - drawing.fixture[1]) / scale == pytest.approx(708, rel=0.02)


@pytest.mark.parametrize("name", ["panda/tracker", "panda/camera", "ur5e/camera", "so101/sockets", "so101/wire"])
def test_every_gauge_has_a_drawing_to_scale(name: str) -> None:
    """Height of what stands there and distance of the tool point from axis 1, against the arm's own forward pass."""
    cell = load_cell(name)
    rng, low, high = np.random.default_rng(2), *np.asarray(cell.joint_range)
    q = np.array([low + (high - low) * rng.uniform(0.4, 0.6, len(low)) for _ in range(2)])
    roles = ("mount", "calibrate")
    visits = tuple(
        SimpleNamespace(q=p, role=r, ball=k - 1, length=0.2) for k, (p, r) in enumerate(zip(q, roles, strict=True))
    )
    drive = SimpleNamespace(visits=visits, mounting=FIRST_MOUNTING)
    (drawing,) = mounting_drawings(SimpleNamespace(cell=cell, drives=(drive,)))
    stands, on_tool = cell.gauge.ends
    assert on_tool in drawing.holder
    assert stands in drawing.title.lower()
    place = cell.fixtures[0]
    there = place.p_BX + place.R_BX @ cell.balls[0].p_GS if cell.gauge.at_balls else place.p_BX
    assert drawing.position == tuple(np.round(1e3 * there))
    assert drawing.away == pytest.approx(1e3 * np.hypot(*there[:2]))
    scale = (drawing.fixture[0] - drawing.base[0]) / drawing.away
    along = 1e3 * cell.map_position(q[:1] if cell.has_bar() else q[1:])[0][:2] @ there[:2] / np.hypot(*there[:2])
    assert (drawing.ball[0] - drawing.base[0]) / scale == pytest.approx(along, abs=0.2 / scale)
    named = [name for _, names in drawing.others for name in names.split(", ")]
    assert len(named) == len(set(named)) == max(len(cell.balls) - 1, 0)
    places = np.array([p for p, _ in drawing.others]).reshape(-1, 2)
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 100 * np.eye(len(places))
    assert apart.size == 0 or apart.min() >= 10  # names do not stand on each other
    assert all(f"{b.name} [" in drawing.places for b in cell.balls[1:])
    assert all(0 <= x <= 480 and 0 <= y <= 210 for x, y in (drawing.fixture, drawing.ball, drawing.flange))


@pytest.mark.parametrize(
    ("tolerance", "enough", "headline"),
    [
        (None, 0.0, "Expected: 95 of 100 targets within 0.81 mm, such robots uncalibrated 6.4 mm"),
        (1e-3, 0.97, "Foreseen: good enough for 1 mm"),
        (1e-3, 0.5, "Not known whether it will be good enough for 1 mm"),
        (1e-4, 0.0, "Foreseen: not good enough for 0.1 mm"),
    ],
)
def test_a_plan_says_first_whether_it_is_good_enough(
    plan: Plan, tolerance: float | None, enough: float, headline: str
) -> None:
    numbers = (ErrorByNumber(14, 4e-4, 10.0), ErrorByNumber(28, 3e-4, 18.0), ErrorByNumber(56, 2e-4, 30.0))
    unknown = SimpleNamespace(where="over the workspace")
    foreseen = ErrorForecast(unknown, 3e-4, 5e-4, numbers)  # type: ignore[arg-type]
    told = judge_plan(replace(plan, forecast=foreseen, targets=TargetForecast(6.4e-3, 8.1e-4, tolerance, enough)))
    assert told.headline == headline
    assert "0.81 mm" in told.headline + told.because
    assert told.changes == (
        ("Better: --poses 56", "0.81 mm → 0.54 mm, about 30 min"),
        ("Quicker: --poses 14", "0.81 mm → 1.1 mm, about 10 min"),
    )


@pytest.mark.parametrize("before", [2e-3, 56e-3])
def test_a_robot_that_may_be_farther_off_than_its_path_is_clear_is_driven_slowly_first(
    plan: Plan, before: float
) -> None:
    clear, room = min(d.clearance for d in plan.drives), 2 * max(f.prior for f in plan.cell.fixtures)
    content = report_plan(replace(plan, targets=TargetForecast(before, 8.1e-4, None, 0.0))).content
    said = "the first drive may collide. Drive slowly, a hand on the stop."
    assert (said in str(content["first_drive"])) == (before + room > clear)


def test_head_says_plan_cell_and_notes(plan: Plan, page: ReadPage) -> None:
    assert PLAN_ID in page.text
    assert NOTE in page.text
    assert plan.cell.robot.title in page.text
    assert plan.cell.name in page.text


def test_certificate_in_words_holds(plan: Plan, page: ReadPage) -> None:
    choice = plan.choice
    found = re.search(
        r"No (\d+) of the ([\d\u202f]+) candidate poses have a condition number in m, rad below ([\d.]+)\.", page.text
    )
    assert found
    assert int(found[1]) == len(choice.q)
    assert int(found[2].replace("\u202f", "")) == len(plan.pool)
    assert choice.certificate.value * 0.999 < float(found[3]) <= choice.certificate.value
    worst = re.search(r"have ([\d.]+): at most ([\d.]+) % above what is possible", page.text)
    assert worst
    assert float(worst[1]) == pytest.approx(choice.on_grid_value, rel=1e-3)
    assert float(worst[2]) / 100 == pytest.approx(choice.on_grid_value / choice.certificate.value - 1, abs=1.1e-3)
    assert float(worst[2]) / 100 >= choice.on_grid_value / choice.certificate.value - 1


def test_poses_are_those_of_the_plan(plan: Plan, page: ReadPage) -> None:
    rows, visits = page.table("pose"), plan.drives[0].visits
    assert [int(r[0]) for r in rows] == [v.id for v in visits]
    assert {r[1] for r in rows} == {FIXTURE}
    assert [r[2].split()[0] for r in rows] == [v.role for v in visits]
    for row, visit in zip(rows, visits, strict=True):
        assert float(row[3]) == pytest.approx(visit.length * 1000, abs=0.0051)
        assert np.allclose([float(v) for v in row[4:]], np.degrees(visit.q), atol=5.1e-4)


def test_columns_that_no_row_fills_are_left_out(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(plan.cell.gauge), "visit_cells", lambda *_: ("", ""))
    page = ReadPage()
    page.feed(report_plan(plan).html())
    assert all(len(row) == 2 + len(v.q) for row, v in zip(page.table("pose"), plan.drives[0].visits, strict=True))


def test_sigmas_are_those_of_the_normal_equations(plan: Plan, page: ReadPage) -> None:
    choice = plan.choice
    J = choice.model.rows(choice.samples)[:, 0]
    weighted = J / choice.model.noise(choice.samples)[:, None] * choice.model.prior
    share = np.sqrt(np.diag(np.linalg.inv(weighted.T @ weighted)))  # in prior sigmas: the inverse is well conditioned
    rows = page.table("parameter")
    assert [r[0] for r in rows] == list(choice.model.names)
    assert np.allclose([float(r[5]) for r in rows], share, rtol=6e-3)
    factor = np.array([1e3 if r[2] == "mm" else 180 / np.pi for r in rows])
    assert np.allclose([float(r[4]) for r in rows], share * choice.model.prior * factor, rtol=6e-3)


def test_unseen_parameters_stand_with_their_reason(plan: Plan, page: ReadPage) -> None:
    assert plan.choice.seen.dropped
    cells = {tuple(row) for table in page.tables for row in table}
    assert {(d.name, f"why{d.because}") for d in plan.choice.seen.dropped} <= cells  # unfolded on demand


def test_indices_are_those_of_the_plan(plan: Plan, page: ReadPage) -> None:
    rows = {r[0]: r for r in page.table("index")}
    assert list(rows) == list(INDEX_RULES)
    for name, row in rows.items():
        assert float(row[3]) == pytest.approx(plan.choice.raw_indices[name], rel=1e-3)
        assert float(row[4]) == pytest.approx(plan.choice.scaled_indices[name], rel=1e-3)


@pytest.mark.slow
def test_two_fixtures_have_their_own_pictures(plan: Plan) -> None:
    cell = replace(plan.cell, fixtures=plan.cell.fixtures * 2)
    second = replace(plan.drives[0], course=replace(plan.drives[0].course, mounting=Mounting(1)))
    read = ReadPage()
    read.feed(report_plan(replace(plan, cell=cell, drives=(plan.drives[0], second))).html())
    assert len(read.table("pose")) == 2 * len(second.visits)
    assert {"bar_1", "bar_2", "tour_1", "tour_2"} < read.ids
    labels = next(json.loads(text)["labels"] for a, text in read.scripts if a.get("id") == "scene")
    assert all(f"fixture {FIXTURE}" in label for label in labels)


def test_folder_must_exist(plan: Plan, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        report_plan(plan).write(tmp_path / "nowhere")
