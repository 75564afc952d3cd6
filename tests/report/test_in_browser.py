"""Pages of plans and calibrations in a browser; no kind of page is left out; a picture and its place are one."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner.report.calibration_charts as calibration_charts
from planner.report.calibration_report import report_calibration
from planner.report.chart import BLUE, Chart, Panel, Series, list_panel, log_ticks
from planner.report.page import FOLDER, Report
from planner.report.plan_report import report_plan
from planner.report.svg_backend import chart_html
from planner.session.plan_types import Plan
from tests.browser import Browser
from tests.report.calibrated import calibrated

TESTS = Path(__file__).parents[1]


def kept(report: Report, folder: Path) -> Path:
    page = folder / "report.html"
    page.write_text(report.html(), encoding="utf-8")
    return page


@pytest.mark.slow
def test_a_plan(browser: Browser, plan: Plan, tmp_path: Path) -> None:
    report = report_plan(plan)
    shown = browser.check_report(kept(report, tmp_path))  # plan.html.j2
    assert sorted(shown) == sorted(["view", *(c.name for c in report.charts)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "count"),
    [
        ("edbb_static", 90),
        pytest.param("tracker", 60, marks=pytest.mark.long),
        pytest.param("balls", 60, marks=pytest.mark.long),
    ],
)
def test_a_calibration(
    browser: Browser, kind: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a bar, by a tracker with the chart of what causes without a name leave open, and by balls."""
    if kind == "tracker":
        monkeypatch.setattr(calibration_charts, "misfit_place", lambda released: released)
    report = report_calibration(calibrated(kind, count))
    assert ("misfit" in [c.name for c in report.charts]) == (kind == "tracker")
    shown = browser.check_report(kept(report, tmp_path))  # calibration.html.j2
    assert shown == [c.name for c in report.charts]


def test_every_kind_of_page_is_opened() -> None:
    texts = {f.name: f.read_text(encoding="utf-8") for f in FOLDER.glob("*.html.j2")}
    pages = {name for name, text in texts.items() if '{% extends "base.html.j2" %}' in text}
    opened = re.compile(r"browser\.check_report\(.*#\s*(\S+\.html\.j2)")
    seen = {name for f in TESTS.rglob("test_*.py") for name in opened.findall(f.read_text(encoding="utf-8"))}
    assert seen == pages


def line_chart(name: str) -> Chart:
    one = Series("one", np.arange(3.0), np.arange(3.0), "#000000")
    return Chart(name, "A line", "drawn", (Panel("a line", "x", "y", (one,)),))


def test_a_picture_that_a_page_does_not_show_is_refused() -> None:
    content = {"title": "t", "model": "m", "due": "d", "head": (), "rows": ()}
    page = Report("record.html.j2", content, (line_chart("drift"),))
    assert 'id="drift"' in page.html()
    with pytest.raises(ValueError, match="does not show other"):
        replace(page, charts=(line_chart("drift"), line_chart("other"))).html()


def test_a_picture_that_a_page_shows_twice_is_refused() -> None:
    chart = line_chart("one")
    content = {"title": "t", "run": "r", "sentences": (), "notes": (), "chart": chart, "table": "", "head": ()}
    page = Report("judged.html.j2", content | {"rows": (), "numeric": ()}, (chart,))
    assert page.html().count('id="one"') == 1
    with pytest.raises(KeyError):
        replace(page, charts=()).html()


@pytest.mark.parametrize("low", [3e-7, 0.02, 0.412, 1.0, 87.0])
@pytest.mark.parametrize("times", [1.02, 1.5, 3.0, 8.0, 40.0, 1e5])
def test_a_logarithmic_axis_has_ticks_that_differ_and_are_what_they_say(low: float, times: float) -> None:
    values, texts = log_ticks((low, low * times), "1e{}")
    inside = [(v, t) for v, t in zip(values, texts, strict=True) if low <= v <= low * times]
    assert 2 <= len(inside) <= 8
    assert len(dict(map(reversed, inside))) == len(inside)
    assert np.allclose([float(t) for _, t in inside], [v for v, _ in inside], rtol=1e-9)
    assert (np.diff(values) > 0).all()


def test_numbers_below_a_panel_have_room_on_a_phone() -> None:
    """Eight powers of ten beside names: those that are left out have a class that a phone hides."""
    bars = Series("", np.array([1e6, 1e3]), np.arange(2.0), BLUE, "bars", texts=("1", "2"))
    panel = list_panel("", "", ("a long name of a row", "b"), [bars], 38, log_x=True, x_range=(1.0, 1e7))
    html = chart_html(Chart("c", "", "", (panel,)))
    across = html[html.index('class="across') :]
    shown = re.findall(r'class="tick(?: end)?" style="[^"]*">(.*?)</span>', across)
    assert 2 <= len(shown) <= 4
    assert across.count(" spare") == 8 - len(shown)
