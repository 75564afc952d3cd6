"""What a person is told of one robot: sound, with an axis that lost its zero, with a tool that was moved."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from planner.checks.evaluation import evaluate_check
from planner.checks.results import CheckForecast, verdict_content, verdict_overview
from planner.common.errors import InputError
from planner.common.units import DEG, MM
from planner.documents.baseline import Baseline
from planner.report.check_report import report_check
from tests.checks.fleet import NAME, fleet, tracker_fleet
from tests.identification.worlds import arm_of
from tests.simulation.generator.truth import draw_errors


@cache
def robot():
    rng = np.random.default_rng(5)
    errors = draw_errors(fleet().world.arm, rng)
    return errors, fleet().baseline(errors, rng)


@cache
def judged(limit=None, gear=0.0, **changes):
    errors, baseline = robot()
    after = {k: v + changes.get(k, 0.0) for k, v in errors.items()}
    run = fleet().read(after, np.random.default_rng(7), {1: gear * np.sin(fleet().check.q[:, 1])})
    return evaluate_check(baseline, fleet().cell, run, limit)


@pytest.mark.slow
def test_a_sound_robot_passes():
    verdict = judged()
    assert verdict.passed
    assert verdict.outcome == "unchanged"
    assert "go on" in dict(verdict_overview(verdict).facts)["do"]


def test_an_axis_that_lost_its_zero_is_named_with_its_size():
    verdict = judged(theta3=0.03 * DEG)
    assert verdict.likeliest_change.change.name == "zero of joint 3"
    assert verdict.advice == "master axis 3 and check again"
    assert verdict.likeliest_change.values[0] == pytest.approx(0.03 * DEG, rel=0.3)
    said = verdict_content(verdict, NAME)
    assert (said["outcome"], said["passed"], said["cause"]) == ("changed", False, "zero of joint 3")
    page = report_check(NAME, verdict)
    assert "master axis 3" in " ".join(page.content["sentences"])
    assert page.charts[0].panels[1].y_names[0] == "zero of joint 3"


@pytest.mark.slow
def test_a_worn_gear_and_a_tool_that_was_hit_are_told_apart():
    gear = judged(gear=0.06 * DEG)
    assert "gear of joint 2" in [j.change.name for j in (gear.likeliest_change, *gear.rivals) if j]
    tool = judged(map_x=0.5 * MM, map_y=-0.4 * MM)
    assert tool.likeliest_change.change.name == "tool"
    assert tool.likeliest_change.motion == pytest.approx(np.hypot(0.5, 0.4) * MM, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("turns", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_tracker_that_stands_elsewhere_tells_what_changed(turns):
    f, rng = tracker_fleet(turns), np.random.default_rng(5)
    errors = draw_errors(arm_of(NAME), rng)
    baseline = f.baseline(errors, rng)
    changes = {None: {}, "zero of joint 3": {"theta3": 0.03 * DEG}, "tool": {"map_x": 0.5 * MM}}
    for cause, change in changes.items():
        run = f.read({k: v + change.get(k, 0.0) for k, v in errors.items()}, np.random.default_rng(7))
        verdict = evaluate_check(baseline, f.cell, run)
        said = verdict_content(verdict, NAME)
        assert said["cause"] == cause
        assert said["notes"][-1].startswith("no reading shows the zero of joint 1")
        assert len(said["readings"][0]["difference_um"]) == 3
        assert ("difference_turn_deg" in said["readings"][0]) == turns
    assert verdict.likeliest_change.motion == pytest.approx(0.5 * MM, rel=0.03)
    assert len(report_check(NAME, verdict).charts[0].panels[0].series) == 6
    if turns:
        with pytest.raises(InputError, match="orientations"):
            evaluate_check(baseline, f.cell, replace(run, readings=replace(run.readings, rotation=None)))


@pytest.mark.slow
def test_one_wrong_reading_is_to_be_read_again_and_no_robot_is_calibrated_for_it():
    """Over robots and poses; a change of the robot is not taken for a wrong reading."""
    errors, baseline = robot()
    for k in range(10):
        run = fleet().read(errors, np.random.default_rng([7, k]))
        length = run.readings.length.copy()
        length[k] += 9 * MM * (-1) ** k
        verdict = evaluate_check(baseline, fleet().cell, replace(run, readings=replace(run.readings, length=length)))
        assert not verdict.passed
        assert verdict.doubtful == f"number {k + 1}"
        assert dict(verdict_overview(verdict).facts)["do"].startswith(f"read again number {k + 1}")
        assert verdict_content(verdict, NAME)["doubtful"] == f"number {k + 1}"
    for change in ({"theta2": 0.05 * DEG}, {"theta4": -0.1 * DEG}, {"theta5": 0.1 * DEG}, {"map_z": 0.6 * MM}):
        assert judged(**change).doubtful == ""
        assert not judged(**change).passed


def test_a_change_within_the_users_limit_passes():
    errors = {"theta3": 0.03 * DEG}
    assert judged(5 * MM, **errors).outcome == "changed within the limit"
    assert judged(0.05 * MM, **errors).outcome == "changed"


def test_a_forecast_is_of_the_sizes_that_the_check_then_has():
    errors, baseline = robot()
    run = fleet().read(errors, np.random.default_rng(1))
    forecast = CheckForecast.of(baseline, fleet().cell, run.samples)
    sizes = {c.name: d for c, d in zip(forecast.changes, forecast.detectable, strict=True)}
    for j in judged().judged:
        if j.change.kind in ("zero", "tool", "fixture"):
            assert sizes[j.change.name] == pytest.approx(j.detectable, rel=0.15)


def test_runs_that_are_no_check_are_refused():
    errors, baseline = robot()
    run = fleet().read(errors, np.random.default_rng(1))
    for wrong, words in (
        (replace(run, continuous=True), "at rest"),
        (replace(run.take(slice(0, 3))), "needs 4"),
        (replace(run, robot="ur10"), "ur10"),
    ):
        with pytest.raises(InputError, match=words):
            evaluate_check(baseline, fleet().cell, wrong)
    other = baseline.file.model_copy(update={"gauge": "tracker"})
    with pytest.raises(InputError, match="gauge of the baseline"):
        Baseline.of(other, fleet().cell, "posterior.json")
