"""The page of a calibration: loads nothing, tells the truth, stays small, prints the same bytes."""

import json
import math
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.documents.calibration import Calibration, PlannedTargets
from planner.documents.calibration_summary import summarize
from planner.model.use_text import bound_text
from planner.release.suitability import judge_use, target_errors
from planner.report.calibration_charts import draw_calibration_charts, histogram_chart, residual_chart
from planner.report.calibration_data import PANEL_POINTS, CalibrationFacts
from planner.report.calibration_report import calibration_content, report_calibration
from planner.report.calibration_text import correlation_text, proof_text, refusal_text
from planner.workflow.fit_overview import fit_overview
from tests.report.calibrated import calibrated
from tests.report.reading import ReadPage


@pytest.fixture(scope="module")
def c() -> Calibration:
    return calibrated("edbb_static", 90)


@pytest.fixture(scope="module")
def folder(c: Calibration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("calibration")
    report_calibration(c).write(place)
    return place


@pytest.fixture(scope="module")
def page(folder: Path) -> ReadPage:
    read = ReadPage()
    read.feed((folder / "report.html").read_text(encoding="utf-8"))
    read.close()
    return read


@pytest.mark.slow
def test_page_loads_nothing_from_elsewhere(page: ReadPage) -> None:
    assert all(load.startswith("data:") for load in page.loads)
    assert "url(" not in page.styles
    assert "@import" not in page.styles
    assert not [text for _, text in page.scripts if re.search(r"fetch\(|XMLHttpRequest|https?:|import\(", text)]


@pytest.mark.slow
def test_same_calibration_gives_same_bytes(c: Calibration, folder: Path) -> None:
    assert report_calibration(c).html() == (folder / "report.html").read_text(encoding="utf-8")
    assert (folder / "report.html").stat().st_size < 1_500_000
    assert [p.name for p in folder.iterdir()] == ["report.html"]


def test_every_chart_has_its_place_and_finite_numbers(c: Calibration, page: ReadPage) -> None:
    drawn = draw_calibration_charts(CalibrationFacts(c)).every
    names = {chart.name for chart in drawn}
    assert {"histogram", "by_pose", "residual_joints", "residual_loads", "residual_gauge", "correlation"} <= names
    assert {"residual_circumstances", "residual_approach"} <= names <= page.ids
    for chart in drawn:
        for series in (s for panel in chart.panels for s in panel.series):
            assert np.isfinite([*series.x, *series.y]).all(), chart.name
    assert "nan" not in page.text.lower().split()


def test_five_things_come_first_and_are_those_of_screen_and_document(c: Calibration, folder: Path) -> None:
    told = summarize(c)
    html = (folder / "report.html").read_text(encoding="utf-8")
    first = unescape(
        re.sub(r"<(style|script).*?</\1>|<[^>]+>", " ", html[: html.index('class="sections"')], flags=re.S)
    )
    screen = fit_overview(c).text()
    assert told.because in fit_overview(c).text(verbose=True)
    document = json.dumps(c.model_copy(update={"summary": told}).content()["summary"], ensure_ascii=False)
    for said in (told.headline, *(line.what for line in told.causes), *(s.what for s in told.next_steps)):
        assert all(said in text for text in (" ".join(first.split()), screen, document)), said
    assert told.meaning in " ".join(first.split())
    assert told.meaning in screen
    assert len(told.causes) <= 3
    assert 1 <= len(told.next_steps) <= 2
    assert len(screen.splitlines()) <= 8
    assert len(re.findall(r"\smm", first)) < 14
    assert told.headline.startswith(f"95 of 100 targets within {told.figure}, ")
    assert "rms" not in first
    assert 'class="mark simulated"' not in html


def test_causes_are_counted_once(c: Calibration) -> None:
    """The section counts those of the first screen, and lists them in the same order."""
    facts = CalibrationFacts(c)
    content, named = calibration_content(facts), facts.causes
    assert named[: len(facts.summary.causes)] == facts.summary.causes
    sure = sum(not line.how_sure.startswith("doubtful") for line in named)
    assert content["causes_about"].startswith(f"{sure} found or likely")
    headings = [heading for heading, _, _ in content["findings"]]
    assert len(headings) == len(c.findings) + 1
    assert headings[0] == named[0].what
    assert content["causes_more"] == len(named) - len(facts.summary.causes)


def test_a_line_never_breaks_before_a_unit(c: Calibration) -> None:
    html = report_calibration(c).html()
    shown = html[html.index("<body") : html.index('class="sections"')]
    assert not re.search(r"\d (mm|%|µrad)\W", re.sub(r"<svg.*?</svg>", "", shown, flags=re.S))


def test_the_scale_of_the_maps_reaches_the_figure_before(c: Calibration) -> None:
    (picture,) = draw_calibration_charts(CalibrationFacts(c)).picture
    most = {panel.field.most for panel in picture.panels}
    assert len(most) == 1
    assert most.pop() >= 0.97e3 * summarize(c).targets_within_before


def test_at_most_600_words_are_open(folder: Path) -> None:
    html = (folder / "report.html").read_text(encoding="utf-8")
    body = re.sub(r"<(script|style).*?</\1>", "", html[html.index("<body") :], flags=re.S)
    shown = re.sub(r"<details>\s*(<summary>.*?</summary>).*?</details>", r"\1", body, flags=re.S)
    assert 60 < len(re.sub(r"<[^>]+>", " ", shown).split()) < 600


def test_the_figure_is_what_95_of_100_targets_are_within(c: Calibration) -> None:
    """Draws robots anew from the posterior and counts targets within the figure."""
    told, released = summarize(c), c.released
    assert released is not None
    errors = target_errors(released, released.fit, released.tool)
    within = (errors <= told.targets_within).mean(axis=0)
    assert told.tool == "measured"
    assert (within >= 0.95).mean() >= 0.95
    assert (errors <= 0.8 * told.targets_within).mean(axis=0).min() < 0.95
    another = summarize(c, "another")
    assert another.targets_within > told.targets_within
    assert another.next_steps[0].what.startswith("Measure 20 poses with a second tool point")


@pytest.mark.parametrize(("times", "answer"), [(3.0, "yes"), (0.05, "no")])
def test_a_tolerance_is_answered_in_the_headline(c: Calibration, times: float, answer: str) -> None:
    assert c.released is not None
    tolerance = round(times * summarize(c).targets_within, 6)
    use = judge_use(c.released, 1e-5, tolerance)
    told = summarize(c.model_copy(update={"good_for": use}))
    assert told.answer == answer
    assert (
        told.headline
        == f"{'Good' if answer == 'yes' else 'Not good'} enough for {tolerance * 1e3:g} mm with the measured tool point"
    )
    assert (told.next_steps[0].what == "Correct your programs: edbb compensate") or answer == "no"


def test_what_makes_the_verdict_doubtful_stands_beside_it_and_is_not_folded_away(c: Calibration) -> None:
    note = "90 parameters were fitted to 91 independent readings: little is left to judge them by; measure more"
    doubtful = c.model_copy(update={"warnings": (*c.warnings, note), "doubts": (note,)})
    html = report_calibration(doubtful).html()
    assert html.index("<h1") < html.index(note.partition(";")[0]) < html.index("<h3>What to do next</h3>")
    assert html.count(note) == 1  # with what helps, among the warnings


def test_charts_of_held_out_errors_name_the_stages_as_the_table_does(c: Calibration) -> None:
    facts = CalibrationFacts(c)
    rows = [row[0] for row in calibration_content(facts)["stages"]]
    proof = {chart.name: chart for chart in draw_calibration_charts(facts).proof}
    for name in ("histogram", "by_pose"):
        assert proof[name].title.startswith("Held-out error")
        labels = [series.name.partition(",")[0] for series in proof[name].panels[0].series]
        assert labels == [rows[1], rows[-1]] == ["frames", "calibrated"]


def test_a_calibration_says_whether_it_is_what_its_plan_expected_and_why_not(c: Calibration) -> None:
    within = summarize(c).targets_within
    assert within is not None
    assert summarize(c).planned is None

    def beside(times: float, poses: int = c.n_groups) -> tuple[bool | None, str]:
        shown = summarize(c.model_copy(update={"planned_targets": PlannedTargets(times * within, poses)}))
        return shown.as_planned, shown.planned or ""

    assert beside(1.1)[0] is True
    held, said = beside(0.5)
    assert held is False
    assert said.startswith(f"{bound_text(0.5 * within)} for a robot of this kind. This run leaves ")
    assert f"because 10 of {c.n_groups + 10} planned poses are missing" in beside(0.5, c.n_groups + 10)[1]
    assert "missing" not in beside(0.5, c.n_groups + 1)[1]
    planned = c.model_copy(update={"planned_targets": PlannedTargets(0.5 * within, c.n_groups)})
    assert summarize(planned, "another").planned is None  # the plan is of the measured tool point
    shown = planned.model_copy(update={"summary": summarize(planned)})
    assert f"  planned     {bound_text(0.5 * within)} for a robot" in fit_overview(shown).text()
    assert f"Planned: {said}" in report_calibration(shown).html().replace("\u00a0", " ")


def test_proof_is_the_error_of_readings_not_seen(c: Calibration) -> None:
    said = " ".join(proof_text(CalibrationFacts(c)))
    assert c.released
    before, after = next(s for s in c.stages if s.name == "frames"), c.released
    found = re.search(r"Held-out error of lengths, mean ([\d.]+) mm → ([\d.]+) mm, .* on poses that no fit saw", said)
    assert found
    assert float(found[1]) == pytest.approx(1e3 * np.abs(before.held_residual).mean(), rel=6e-3)
    assert float(found[2]) == pytest.approx(1e3 * np.abs(after.held_residual).mean(), rel=6e-3)


def test_a_calibration_that_brings_nothing_says_so(c: Calibration) -> None:
    frames = c.stages[1]
    assert c.released
    assert c.release
    robot = replace(c.released, held_out=frames.held_out, held_residual=frames.held_residual)
    release = c.release.model_copy(update={"held_out": frames.held_out})
    stages = (*c.stages[:2], frames.model_copy(update={"name": "geometry"}))
    worse = c.model_copy(update={"stages": stages, "released": robot, "release": release})
    assert "brought nothing" in " ".join(proof_text(CalibrationFacts(worse)))


def test_a_refused_fit_does_not_boast(c: Calibration) -> None:
    bad = c.model_copy(update={"problems": ("joint 9 came out odd", "the fit is worse than nothing")})
    assert "→" in " ".join(proof_text(CalibrationFacts(c)))
    assert "→" not in " ".join(proof_text(CalibrationFacts(bad)))
    told = summarize(bad)
    assert (told.answer, told.headline) == ("no", "Do not use this calibration")
    assert (told.causes, told.targets_within) == ((), None)
    assert refusal_text(bad) == (
        "Not to be used, for 2 reasons:",
        "joint 9 came out odd.",
        "the fit is worse than nothing.",
    )


def test_problems_stand_first_and_in_red(c: Calibration) -> None:
    bad = c.model_copy(update={"problems": ("joint 9 came out <b>odd</b>",)})
    assert refusal_text(bad) == ("Not to be used, because joint 9 came out <b>odd</b>.",)
    html = report_calibration(bad).html()
    body = html[html.index("<body") :]
    assert "joint 9 came out &lt;b&gt;odd&lt;/b&gt;" in body
    assert body.index('class="refused"') < body.index('class="first"')
    assert re.search(r"\.refused \{[^}]*color: #8a0018", html)


def test_stage_table_is_that_of_the_calibration(c: Calibration, page: ReadPage) -> None:
    *rows, written = page.table("")[1:]
    assert c.release
    assert written[0] == "calibrated"
    assert float(written[3]) == pytest.approx(c.release.held_out.rms * 1e3, rel=6e-3)
    assert [r[0] for r in rows] == [s.name for s in c.stages]
    assert [int(r[1]) for r in rows] == [s.parameters for s in c.stages]
    for row, stage in zip(rows, c.stages, strict=True):
        assert float(row[3].split(" ± ")[0]) == pytest.approx(stage.held_out.rms * 1e3, rel=6e-3)
        assert float(row[5]) == pytest.approx(np.abs(stage.held_residual).max() * 1e3, rel=6e-3)


def test_parameters_stand_with_value_and_deviation(c: Calibration, page: ReadPage) -> None:
    rows = {r[0]: r for r in page.table("parameter")}
    seen = {e.name: e for e in c.estimates if e.identifiable}
    assert list(rows) == list(seen)
    for name, e in seen.items():
        factor = 1e3 if e.unit == "m" else math.degrees(1)
        nominal, value, change, std = (float(v) for v in rows[name][3:7])
        step = e.std * factor
        assert nominal == pytest.approx(e.nominal * factor, abs=0.6e-6)
        assert value == pytest.approx(e.value * factor, abs=0.06 * step)
        assert change == pytest.approx((e.value - e.nominal) * factor, abs=0.06 * step)
        assert std == pytest.approx(step, rel=0.06)
        assert float(rows[name][7]) == pytest.approx(abs(e.value - e.nominal) / e.std, abs=0.051)
        assert rows[name][9] == ", ".join(e.absorbs)
    held = {r[0]: r[1].partition("why")[2] for r in page.table("unseen")}  # unfolded on demand
    assert held == {e.name: e.because for e in c.estimates if not e.identifiable}
    factor = {"m": 1e3, "rad": math.degrees(1)}
    for e in (e for e in c.estimates if not e.identifiable):
        (row,) = [r for r in page.table("unseen") if r[0] == e.name]
        assert float(row[4]) == pytest.approx(e.value * factor[e.unit], abs=0.06 * e.std * factor[e.unit])
        assert float(row[5]) == pytest.approx(e.std * factor[e.unit], rel=0.06)


def test_pairs_in_words_hold() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((2, 200_000))
    b = 0.98 * x + math.sqrt(1 - 0.98**2) * y
    for sign, better in ((1, "difference"), (-1, "sum")):
        said = correlation_text(("p", "q"), np.corrcoef(x, sign * b))
        found = re.search(rf"p and q \(([+−-][\d.]+)\).* knows their {better} ([\d.]+) times better", said[0])
        assert found
        assert float(found[1]) == pytest.approx(sign * 0.98, abs=2e-3)
        apart = np.std(x - b) / math.sqrt(2)  # of two independent ones it would be 1
        assert float(found[2]) == pytest.approx(1 / apart, rel=0.05)
    assert "No two parameters" in correlation_text(("p", "q"), np.array([[1, 0.3], [0.3, 1]]))[0]


def test_outliers_are_listed(c: Calibration) -> None:
    weight = np.ones(len(c.run))
    weight[[4, 17]] = 0.02, 1e-4
    named = calibration_content(CalibrationFacts(c.model_copy(update={"row_weight": weight})))["outliers"]
    assert [r[-1] for r in named] == ["2 %", "0.01 %"]
    assert [r[0] for r in named] == ["5", "18"]
    assert float(named[0][3]) == pytest.approx(1e3 * abs(c.stages[-1].residual[4, 0]), rel=6e-3)


def test_histogram_counts_every_reading(c: Calibration) -> None:
    for series in histogram_chart(CalibrationFacts(c)).panels[0].series:
        assert series.y[1:-1:2].sum() == pytest.approx(100.0)


@pytest.mark.slow
def test_long_runs_are_thinned_the_same_way_every_time() -> None:
    told = CalibrationFacts(calibrated("edbb_continuous", 2500, 0.0, False))
    for picture in draw_calibration_charts(told).every:
        for panel in picture.panels:
            assert all(len(s.x) <= PANEL_POINTS for s in panel.series if s.mark == "points" and s.name == "a reading")
    assert np.array_equal(even_positions(10, 20), np.arange(10))
    assert len(even_positions(1_000_000, PANEL_POINTS)) == PANEL_POINTS


def test_line_is_the_mean_of_the_residuals(c: Calibration) -> None:
    picture = residual_chart(CalibrationFacts(c), "joints")
    assert len(picture.panels) == 6
    for panel in picture.panels:
        points, mean = (next(s for s in panel.series if s.name == name) for name in ("a reading", "mean"))
        assert mean.y.min() >= points.y.min()
        assert mean.y.max() <= points.y.max()
        assert abs(mean.y.mean() - points.y.mean()) < 0.1 * points.y.std()


@pytest.mark.slow
def test_tracker_and_balls_have_their_page() -> None:
    for kind in ("tracker", "balls"):
        page = calibration_content(CalibrationFacts(calibrated(kind, 60)))
        assert any("roll, pitch, yaw" in what for what, _ in page["gauge"])
        assert "mm in the flange frame" in dict(page["gauge"])["tool point"]
        assert len(page["stages"]) >= 3


def test_folder_must_exist(c: Calibration, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        report_calibration(c).write(tmp_path / "nowhere")


@pytest.mark.slow
def test_sections_of_a_drive_are_called_so() -> None:
    page = calibration_content(CalibrationFacts(calibrated("edbb_continuous", 2500, 0.0, False)))
    assert "on sections that no fit saw" in page["proof"][0]
    assert any("40 sections in 5 parts" in said for said in page["proof"])
