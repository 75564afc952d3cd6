"""The loop in file and report: findings with their units, evidence that fits the truth, limits, the first sheet."""

import math
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.common.files import data_folder
from planner.common.units import display_unit
from planner.documents.calibration import Calibration
from planner.identification.pipeline import identify
from planner.model.finding import log10_p, p_value
from planner.model.finding_groups import list_causes
from planner.model.identification_document import Identification
from planner.report.calibration_data import CalibrationFacts
from planner.report.calibration_report import calibration_content
from planner.report.calibration_text import _capital, proof_text
from planner.report.chart import weighted_means
from planner.report.effect_evidence import collect_evidence, finding_chart, finding_steps, told_findings
from planner.runs.loader import load_run
from planner.tracing.trace import trace
from tests.identification.few_draws import few_draws
from tests.report.calibrated import calibrated
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import draw_truth

RIPPLE, WAVES = 6e-5, 24.738  # [rad], waves a turn of joint 3
PLAY = 8e-5  # [rad] of joint 2


@pytest.fixture(scope="module")
def c() -> Calibration:
    arm = Arm.from_toml(data_folder("robots") / "comau-nj130" / "robot.toml")
    effects = (
        Effect("reducer-ripple", 3, RIPPLE, (("frequency", WAVES), ("phase", 1.0))),
        Effect("backlash-approach", 2, PLAY),
    )
    made = runs.edbb_static(arm, 160, seed=5, truth=draw_truth(arm, 5, effects))
    with TemporaryDirectory() as place:
        run_file, cell_file = made.write(Path(place))
        with few_draws():
            return identify(load_run(run_file, 6), load_cell(str(cell_file), planning=False), tracer=trace)


@pytest.fixture(scope="module")
def told(c: Calibration) -> CalibrationFacts:
    return CalibrationFacts(c)


@pytest.mark.slow
def test_findings_stand_in_the_file_with_their_units(c: Calibration) -> None:
    content: dict[str, Any] = c.content()
    Identification.model_validate(content)
    by_place = {(f["effect"], f["on"]): f for f in content["findings"]}
    ripple, play = by_place["gear ripple", "joint 3"], by_place["backlash", "joint 2"]
    for f, size in ((ripple, RIPPLE), (play, PLAY)):
        assert f["unit"] == "deg"
        assert abs(f["value"] - math.degrees(size)) < 4 * f["std"]
        assert f["p_value"] == pytest.approx(10 ** f["log10_p"])
        assert f["held_out_gain"] > 0
        own = [p["value"] for p in content["fitted"] if p["group"] == f"{f['effect']}, {f['on']}"]
        shape = [p for p in content["fitted"] if p["name"].endswith("frequency") and f is ripple]
        assert math.hypot(*(v for v in own if not shape or v != shape[0]["value"])) == pytest.approx(
            f["value"], rel=1e-6
        )
    inner = ripple["inner"]
    assert inner["name"] == "frequency"
    assert inner["unit"] == "1/turn"
    assert abs(inner["value"] - WAVES) < 4 * inner["std"]
    whole = next(p for p in content["fitted"] if p["name"] == "gear ripple, joint 3, frequency")
    assert whole["value"] == pytest.approx(inner["value"], abs=inner["std"])
    assert "inner" not in play


@pytest.mark.slow
def test_chance_too_small_for_a_number_is_null(c: Calibration) -> None:
    assert c.tried is not None
    chance = {"p_value": p_value(-math.inf), "log10_p": log10_p(-math.inf)}
    sure = c.model_copy(update={"findings": (c.findings[0].model_copy(update=chance),)})
    found_one = sure.content()["findings"][0]
    assert found_one["log10_p"] is None
    assert 0 <= found_one["p_value"] < 1e-300


@pytest.mark.slow
def test_limits_and_what_was_tried_stand_in_the_file(c: Calibration) -> None:
    content: dict[str, Any] = c.content()
    assert content["tried"] > 100
    limits = {(x["effect"], x["on"]): x for x in content["limits"]}
    assert ("backlash", "joint 2") not in limits
    assert limits["backlash", "joint 3"]["unit"] == "deg"
    assert 0 < limits["backlash", "joint 3"]["size"] < math.degrees(1e-3)
    untraced = calibrated("edbb_static", 90).content()
    assert untraced["findings"] == []
    assert untraced["limits"] == []
    assert untraced["tried"] is None


@pytest.mark.slow
def test_ripple_shows_before_and_is_gone_after(told: CalibrationFacts) -> None:
    step = next(s for s in finding_steps(told) if s.what == "gear ripple, joint 3")
    e = collect_evidence(told, step)
    assert e.against.period == pytest.approx(360 / WAVES, rel=1e-2)
    phase = 2 * np.pi * e.against.folded_values / e.against.period
    waves = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    sizes = []
    for values in (e.before, e.after, e.fitted):
        root = np.sqrt(e.weight)
        sizes.append(np.linalg.norm(np.linalg.lstsq(waves * root[:, None], values * root, rcond=None)[0]))
    assert sizes[0] == pytest.approx(RIPPLE, rel=0.3)
    assert sizes[2] == pytest.approx(RIPPLE, rel=0.25)
    assert sizes[1] < 0.25 * sizes[0]


@pytest.mark.slow
def test_play_shows_on_both_sides(told: CalibrationFacts) -> None:
    step = next(s for s in finding_steps(told) if s.what == "backlash, joint 2")
    e = collect_evidence(told, step)
    assert set(np.unique(e.against.values)) <= {-1.0, 0.0, 1.0}
    sides, mean = weighted_means(e.against.values, e.before, e.weight)
    gap = abs(mean[sides == 1.0] - mean[sides == -1.0])
    assert gap == pytest.approx(PLAY, rel=0.35)
    assert abs(np.ptp(weighted_means(e.against.values, e.after, e.weight)[1])) < 0.3 * gap


@pytest.mark.slow
def test_what_was_taken_out_again_is_not_what_an_effect_is_drawn_beside(c: Calibration) -> None:
    """The stage before had another effect in this one's place: it is drawn as what is left with it taken out again."""
    geometry, *_, last = c.stages[2:]
    rival = geometry.model_copy(update={"name": "gauge lag, gauge", "effects": ("gauge lag, gauge",)})
    changed = CalibrationFacts(c.model_copy(update={"stages": (*c.stages[:3], rival, last)}))
    for step in finding_steps(changed):
        assert step.replaced
        assert step.before.name == rival.name
        e = collect_evidence(changed, step)
        assert np.allclose(e.before, e.after + e.fitted)


@pytest.mark.slow
def test_every_finding_has_its_picture_and_evidence(told: CalibrationFacts) -> None:
    page = calibration_content(told)
    every = told_findings(told)
    geometry, *found = page["findings"]
    assert geometry[0].startswith("Lengths and angles of the arm")
    assert [name for _, name, _ in found] == [t.name if t.steps else "" for t in every]
    assert [t.finding for t in every] == list(told.calibration.findings)
    assert [t.finding.name for t in every if t.steps] == ["gear ripple, joint 3", "backlash, joint 2"]
    for (heading, _, lines), one in zip(found, every, strict=True):
        assert "Rivals" in lines[-1]
        assert one.finding.note.lower() == heading.lower()
        if not one.steps:
            assert "too faint for one of its own" in lines[0]
            continue
        picture = finding_chart(told, one)
        assert len(picture.panels) == 2
        assert all(np.isfinite(s.x).all() and np.isfinite(s.y).all() for p in picture.panels for s in p.series)
    assert page["joints"] == tuple(f"joint {j}" for j in range(1, 7))
    play = next(row for row in page["limits"] if row[0] == "backlash")
    assert play[3] == ""  # joint 2 was found
    assert 1 < float(play[4]) < 1000


@pytest.mark.slow
def test_a_fall_of_errors_that_several_causes_brought_together_is_told_once(c: Calibration) -> None:
    together = CalibrationFacts(c.model_copy(update={"stages": (*c.stages[:3], c.stages[-1])}))
    sections = [lines for _, name, lines in calibration_content(together)["findings"] if name]
    assert len(sections) >= 2
    told_in = [k for k, lines in enumerate(sections) if any(line.startswith("Held-out error") for line in lines)]
    assert told_in == [0]
    assert all(any("added together with cause 2:" in line for line in lines) for lines in sections[1:])


@pytest.mark.slow
def test_the_size_of_the_fit_stands_beside_that_of_the_robot_as_written(told: CalibrationFacts) -> None:
    c = told.calibration
    (play,) = (f for f in c.findings if f.effect == "backlash")
    (line,) = (
        lines[0] for heading, _, lines in calibration_content(told)["findings"] if heading == _capital(play.note)
    )
    own = [e.value for e in c.estimates if e.group == "backlash, joint 2"]
    fitted, written = re.findall(r"([\d.]+) (?:± [\d.]+ )?µrad", line)
    assert float(fitted) == pytest.approx(1e6 * abs(play.value), abs=0.06)
    assert float(written) == pytest.approx(1e6 * math.hypot(*own), abs=0.06)


@pytest.mark.slow
def test_the_largest_error_of_the_headline_is_that_of_the_robot_as_written(c: Calibration) -> None:
    """Of a drive too long for each residual of the written robot it was the last stage's, beside the screen's."""
    assert c.release is not None
    errors = c.release.held_out.model_copy(update={"largest": 1.2345e-5})
    of_a_drive = c.model_copy(update={"release": c.release.model_copy(update={"held_out": errors}), "released": None})
    told = CalibrationFacts(of_a_drive)
    assert any("→ 0.0123 mm" in sentence for sentence in proof_text(told))
    assert told.written_stage.held_out.largest != errors.largest


@pytest.mark.slow
def test_many_of_one_kind_have_one_section_and_one_picture(c: Calibration) -> None:
    """Play and ripple at three joints each: two sections, each with the panels of what the fit holds of them."""
    every = tuple(
        f.model_copy(update={"on": on, "inner": None})
        for f in c.findings
        if not f.beside_stages
        for on in (f.on, "joint 5", "joint 6")
    )
    changed = CalibrationFacts(c.model_copy(update={"findings": list_causes(every)}))
    page = calibration_content(changed)
    found = page["findings"][1:]  # the first are lengths and angles
    assert [("of 3 joints" in heading) for heading, _, _ in found] == [True, True]
    for (_, name, lines), one in zip(found, told_findings(changed), strict=True):
        assert name == one.name
        assert "Held-out error" in lines[1]
        assert "the least certain of them" in lines[-1] or one.finding.probability is None
        assert len(finding_chart(changed, one).panels) == 2 * len(one.steps)


@pytest.mark.slow
def test_what_stepped_again_and_again_is_drawn_after_its_last_step(c: Calibration) -> None:
    play = next(f for f in c.findings if f.effect == "backlash").model_copy(update={"after_sample": 7})
    first = next(s for s in c.stages if play.name in s.effects)
    again = first.model_copy(update={"name": f"{play.name}, 3 times"})
    changed = c.model_copy(update={"findings": (play,), "stages": (*c.stages[:3], first, again, c.stages[-1])})
    (step,) = finding_steps(CalibrationFacts(changed))
    assert (step.before.name, step.after.name) == ("geometry", again.name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "value", "said"),
    [
        ("rad", 3e-5, (30.0, "µrad")),
        ("rad/Nm", 2e-7, (0.2, "µrad/Nm")),
        ("rad/rad", 7e-4, (700.0, "ppm")),
        ("m/N", 5e-7, (0.5, "µm/N")),
        ("1", 1e-4, (100.0, "ppm")),
        ("1", 0.4, (40.0, "%")),
        ("s", 4e-3, (4.0, "ms")),
        ("s", 300.0, (300.0, "s")),
        ("1/K", 1.2e-5, (12.0, "ppm/K")),
        ("rad/s", 1e-8, (36.0, "µrad/h")),
        ("1/turn", 24.7, (24.7, "a turn")),
        ("1/m", 1e-6, (1.0, "ppm/m")),
        ("rad/Nm/Nm", 8e-8, (0.08, "µrad/Nm/Nm")),
        ("rad/Nm·turn", 8e-8, (0.08, "µrad/Nm·turn")),
        ("N/m", 8e3, (8e3, "N/m")),
    ],
)
def test_small_numbers_have_units_of_their_size(unit: str, value: float, said: tuple[float, str]) -> None:
    name, factor = display_unit(unit, value)
    assert (pytest.approx(value * factor), name) == said
