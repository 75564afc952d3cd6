"""What the next steps of a calibration promise."""

from types import SimpleNamespace

import pytest

from planner.documents.calibration import PlannedTargets
from planner.documents.calibration_summary import _beside_plan, _how_sure, _next_steps
from planner.model.calibration_summary import CalibrationSummary
from planner.model.finding import Finding
from planner.model.identification_document import ErrorParts
from planner.model.use_statement import ToolUse, Use
from planner.model.use_text import usual_uses_text


@pytest.mark.parametrize(("measured", "left"), [(0.25e-3, "0.25 mm"), (None, "0 mm")])
def test_no_step_promises_less_than_the_error_at_poses_like_those_measured(measured, left):
    """Where one part is the whole error, nothing would be left without it."""
    whole = 1.27e-3  # [m]
    parts = ErrorParts(seen=0.0, unseen=0.0, misfit=0.0, drift=whole)
    release = SimpleNamespace(other_tool=whole, work_tool=None, parts=parts, misfit_place=None, where_measured=measured)
    run = SimpleNamespace(readings=SimpleNamespace(length=None), places=())
    found = SimpleNamespace(workspace_error=whole, more=None, run=run, n_groups=60, good_for=None, reason_not_to_use="")
    warm, _ = _next_steps(found, release, None, "measured", None)
    assert warm.what.startswith("Measure once the arm is warm")
    assert warm.brings == f"1.3 mm → {left} at best"


def test_steps_are_in_the_measure_of_the_headline():
    """What 95 of 100 targets stay within falls from the figure of the page, as the rms error does."""
    parts = ErrorParts(seen=0.0, unseen=0.0, misfit=0.0, drift=0.6e-3)
    release = SimpleNamespace(other_tool=2e-3, work_tool=None, parts=parts, misfit_place=None, where_measured=None)
    run = SimpleNamespace(readings=SimpleNamespace(length=None), places=())
    found = SimpleNamespace(workspace_error=1e-3, more=None, run=run, n_groups=60, good_for=None, reason_not_to_use="")
    tools = [("measured", 2.5e-3), ("another", 6e-3)]
    use = Use(
        repeatability=1e-5,
        tools=tuple(ToolUse(tool=t, targets_within=w, targets_within_before=9e-3) for t, w in tools),
    )
    warm, second = _next_steps(found, release, use, "measured", None)
    assert warm.brings == "2.5 mm → 2.0 mm at best"  # 1 → 0.8 rms
    assert second.brings == "any other tool 6.0 mm → 2.5 mm at best"


@pytest.mark.parametrize(
    ("unseen", "parts", "why"),
    [
        ((), (3e-4, 2e-4, 1e-4), "its readings leave more open than the plan foresaw"),
        ((), (1e-4, 2e-4, 3e-4), "no named cause explains a part of its errors"),
        (("how the base turns",), (1e-4, 3e-4, 2e-4), "no pose shows how the base turns"),
    ],
)
def test_a_run_that_leaves_more_than_its_plan_says_why(unseen, parts, why):
    shown = tuple(SimpleNamespace(what=what) for what in unseen)
    parts = ErrorParts(seen=parts[0], unseen=parts[1], misfit=parts[2])
    release = SimpleNamespace(parts=parts, not_shown=shown)
    by_pose, plan = SimpleNamespace(by="pose"), PlannedTargets(0.84e-3, 100)
    found = SimpleNamespace(n_groups=100, split=by_pose, release=release, tried=300)
    said = f"0.84 mm for a robot of this kind. This run leaves 1.5 mm, because {why}."
    assert _beside_plan(found, plan, 1.5e-3) == {"as_planned": False, "planned": said}
    found.tried = None
    assert "because no causes beyond the geometry were sought." in _beside_plan(found, plan, 1.5e-3)["planned"]


@pytest.mark.parametrize(
    ("within", "said"),
    [
        (0.15e-3, "With its own tool enough for usual handling (1 mm), arc welding (0.5 mm) and drilling (0.2 mm)."),
        (0.2e-3, "With its own tool enough for usual handling (1 mm), arc welding (0.5 mm) and drilling (0.2 mm)."),
        (
            0.47e-3,
            "With its own tool enough for usual handling (1 mm) and arc welding (0.5 mm), not for drilling (0.2 mm).",
        ),
        (0.84e-3, "With its own tool enough for usual handling (1 mm), not for arc welding (0.5 mm)."),
        (0.56e-3, "With its own tool enough for usual handling (1 mm), nearly for arc welding (0.5 mm)."),
        (1.1e-3, "With its own tool nearly enough for usual handling (1 mm)."),
        (1.5e-3, "With its own tool not enough for usual handling (1 mm)."),
    ],
)
def test_without_a_tolerance_usual_uses_say_what_it_is_enough_for(within, said):
    assert usual_uses_text(within, "its own tool") == said


@pytest.mark.parametrize(
    ("probability", "rivals", "said"),
    [
        (0.99, (), "found, 99 % sure"),
        (0.99, ("play",), "found, 99 % sure; else one other cause"),
        (0.58, ("play", "ripple", "unnamed"), "likely, 58 % sure; else one of 3 other causes"),
        (None, ("play",), "found, else one other cause"),
        (None, (), "found"),
    ],
)
def test_a_cause_says_how_sure_it_is_and_what_else_it_may_be(probability, rivals, said):
    cause = Finding(effect="gear ripple", on="joint 1", value=1e-4, unit="rad", probability=probability, rivals=rivals)
    assert _how_sure(cause) == said


@pytest.mark.parametrize(("tool", "named"), [("measured", ""), ("own", "its own tool"), ("another", "any other tool")])
def test_a_figure_beside_a_tolerance_is_one_line_of_the_screen(tool, named):
    other = None if tool == "another" else 1.7e-3
    figures = {
        "tolerance": 1e-3,
        "targets_within": 0.34e-3,
        "targets_within_before": 5.8e-3,
        "other_tool_within": other,
    }
    said = CalibrationSummary(answer="yes", headline="Good enough for 1 mm", because="", tool=tool, **figures).line
    assert said.startswith("95 of 100 targets within 0.34 mm, this robot uncalibrated 5.8 mm")
    assert "95 % sure" in said
    assert named in said
    assert len(f"  within      {said}") <= 120
