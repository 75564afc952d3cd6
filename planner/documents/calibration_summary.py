"""Makes the summary of a calibration: the one source of what screen, page and document say first."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.common.units import display_unit, format_value, to_mm
from planner.documents.calibration import Calibration, PlannedTargets
from planner.fit.assumptions import ANOTHER_TOOL_SHARE
from planner.model.calibration_summary import CalibrationSummary, CauseLine, NextStep
from planner.model.finding import Finding, cause_text, percent
from planner.model.identification_document import Release
from planner.model.use_statement import ToolName, ToolUse, Use, UseAnswer
from planner.model.use_text import TOOLS, ask_for_tolerance, bound_text, share_text, targets_text, usual_uses_text
from planner.release.error_parts import drift_counts, misfit_counts
from planner.release.suitability import judge_use


@dataclass(frozen=True)
class _Step:
    """Something to do, what it leaves of the error, rms [m], and how long it takes, where that is known."""

    what: str
    left: float
    minutes: float | None
    how: str = " at best"


GEOMETRY = "Lengths and angles of the arm"
SECOND_POINT = "Measure 20 poses with a second tool point"


def summarize(c: Calibration, tool: ToolName | None = None, minutes_a_pose: float | None = None) -> CalibrationSummary:
    """Return the summary of a calibration.

    Args:
        c: the calibration.
        tool: the tool that will be used; by default the one that the cell names as the robot's own, else the measured.
        minutes_a_pose: how long a pose of the run took, where that is known.
    """
    r = None if c.reason_not_to_use else c.release
    use = None if r is None else _use_of(c)
    own = use is not None and any(t.tool == "own" for t in use.tools)
    used: ToolName = (tool if tool != "own" or own else None) or ("own" if own else "measured")
    answer, headline, because = _verdict(c, use, used)
    mine = None if use is None else _of_tool(use, used)
    before = None if mine is None else mine.targets_within_before
    plan = None if used != "measured" else c.planned_targets
    return CalibrationSummary(
        answer=answer,
        headline=headline,
        because=because,
        **({} if plan is None or mine is None else _beside_plan(c, plan, mine.targets_within)),
        tolerance=None if use is None else use.tolerance,
        tool=used,
        targets_within=None if mine is None else mine.targets_within,
        targets_within_before=before,
        other_tool_within=None if use is None or used == "another" else _of_tool(use, "another").targets_within,
        causes=() if c.reason_not_to_use else tuple(cause_lines(c, before))[:3],
        next_steps=tuple(_next_steps(c, r, use, used, minutes_a_pose)),
    )


def _use_of(c: Calibration) -> Use | None:
    """What the robot is good for: as it was judged, else for no tolerance in particular."""
    if c.good_for is not None or c.released is None:
        return c.good_for
    return judge_use(c.released, c.setup.robot.repeatability, None, c.setup.robot.repeatability_assumed)


def _of_tool(use: Use, tool: ToolName) -> ToolUse:
    return next(t for t in use.tools if t.tool == tool)


def _verdict(c: Calibration, use: Use | None, tool: ToolName) -> tuple[UseAnswer, str, str]:
    """Return answer, headline and the sentence below it."""
    if c.reason_not_to_use:
        return "no", "Do not use this calibration", f"{_capital(c.reason_not_to_use)}."
    if use is None:
        return "not known", "Not known what this robot is good for", "The error over the workspace was not estimated."
    mine = _of_tool(use, tool)
    if use.tolerance is None or mine.answer is None:
        why = f"{usual_uses_text(mine.targets_within, TOOLS[tool])} {ask_for_tolerance('--tolerance-mm')}"
        return "not known", targets_text(mine.targets_within, mine.targets_within_before, "this robot"), why
    limit = f"{float(to_mm(use.tolerance)):g} mm"
    words = {"yes": "Good enough", "no": "Not good enough", "not known": "Not known whether it is good enough"}
    before = share_text(mine.share_before)
    share = f"Likely {share_text(mine.share)} of targets are within {limit}, uncalibrated {before}"
    return mine.answer, f"{words[mine.answer]} for {limit} with {TOOLS[tool]}", f"{share}."


def _beside_plan(c: Calibration, plan: PlannedTargets, within: float) -> dict[str, Any]:
    """Return whether the targets are ``within`` what the plan expected [m], and why they are not."""
    expected, here = bound_text(plan.within), bound_text(within)
    if within <= plan.within or expected == here:
        return {"as_planned": True, "planned": f"{expected} or less was expected of a robot of this kind."}
    why = f"This run leaves {here}, because {_why_more(c, plan)}."
    return {"as_planned": False, "planned": f"{expected} for a robot of this kind. {why}"}


def _why_more(c: Calibration, plan: PlannedTargets) -> str:
    """Say why a run leaves more than its plan expected, by what is known of it: the first of these that holds."""
    missing = plan.poses - c.n_groups if c.split.by == "pose" else 0
    if missing > plan.poses // 20:
        return f"{missing} of {plan.poses} planned poses are missing"
    if c.tried is None:  # plans expect that causes are traced
        return "no causes beyond the geometry were sought"
    assert c.release is not None
    parts, unseen = c.release.parts, c.release.not_shown
    if parts is not None and parts.misfit > max(parts.seen, parts.unseen):
        return "no named cause explains a part of its errors"
    if unseen:
        return f"no pose shows {unseen[0].what}"
    return "its readings leave more open than the plan foresaw"


def cause_lines(c: Calibration, before: float | None) -> Iterator[CauseLine]:
    """Return why the robot erred: its geometry where that counts, then what tracing found.

    ``before``: what 95 of 100 targets stayed within [m]; the geometry is stated as a part of that.
    """
    r = c.release
    if r is not None and (fell := r.nominal_anywhere**2 - r.geometry_anywhere**2) > 0:
        moved = [e for e in c.estimates if e.identifiable and e.group == "geometry" and e.std]
        first = max(moved, key=lambda e: abs(e.value - e.nominal) / (e.std or 1.0), default=None)
        most = "" if first is None else f", {first.name} most"
        times = 1.0 if before is None else before / r.nominal_anywhere
        yield CauseLine(what=f"{GEOMETRY}{most}", size=bound_text(times * float(np.sqrt(fell))), how_sure="found")
    if c.tried is None:
        return
    for cause in [f for f in c.findings if not f.is_doubtful] or c.findings[:1]:
        yield CauseLine(what=_cause_name(cause), size=_size(cause), how_sure=_how_sure(cause))


def _cause_name(cause: Finding) -> str:
    return _capital(f"{cause_text(cause.effect)}, {cause.on}" if cause.effect != "unnamed" else cause_text(cause.name))


def _size(cause: Finding) -> str:
    unit, factor = display_unit(cause.unit, cause.value)
    if cause.members:
        sizes = [abs(f.value) * factor for f in cause.members]
        return f"{min(sizes):.3g} to {max(sizes):.3g} {unit}"
    return format_value(abs(cause.value), cause.std, unit, factor)


def _how_sure(cause: Finding) -> str:
    others = len(cause.rivals)
    said = [] if cause.probability is None else [f"{percent(cause.probability)} sure"]
    said += [f"else {'one other cause' if others == 1 else f'one of {others} other causes'}"] if others else []
    return f"{cause.grade}, {'; '.join(said)}" if said else cause.grade


def _next_steps(
    c: Calibration, r: Release | None, use: Use | None, tool: ToolName, pace: float | None
) -> list[NextStep]:
    """Return the two steps that bring most, or what to do with a robot that is good enough."""
    if c.reason_not_to_use or r is None:
        return [NextStep(what="Correct what is said above and measure again", brings="")]
    used = {"measured": c.workspace_error, "another": r.other_tool}.get(tool)
    if used is None:
        used = c.workspace_error if r.work_tool is None else r.work_tool.anywhere
    within = used if use is None else _of_tool(use, tool).targets_within
    # what 95 of 100 targets stay within falls as the rms error does
    steps = [(s, within * min(s.left / used, 1.0)) for s in sorted(_steps(c, r, used, pace), key=lambda s: s.left)]
    # 0.97: part of the error that a step must not leave to be named: nobody notices less
    best = [NextStep(what=s.what, brings=_span(within, left, s)) for s, left in steps if left < 0.97 * within]
    if tool == "measured" and r.other_tool**2 - used**2 >= ANOTHER_TOOL_SHARE * r.other_tool**2:
        second = _Step(SECOND_POINT, used, None)
        other = r.other_tool if use is None else _of_tool(use, "another").targets_within
        best.insert(1, NextStep(what=second.what, brings=f"any other tool {_span(other, within, second)}"))
    correct = NextStep(what="Correct your programs: edbb compensate", brings="")
    enough = use is not None and any(t.tool == tool and t.answer == "yes" for t in use.tools)
    return ([correct, *best] if enough else [*best, correct])[:2]


def _steps(c: Calibration, r: Release, used: float, pace: float | None) -> Iterator[_Step]:
    """Return what would make the error smaller, which is ``used``, rms [m]; ``pace``: minutes of a pose."""
    here, parts = c.workspace_error, r.parts

    def minutes(poses: int) -> float | None:
        """Return how long so many poses take."""
        return None if pace is None else poses * pace

    if used**2 - here**2 >= ANOTHER_TOOL_SHARE * used**2:
        yield _Step(SECOND_POINT, here, minutes(20))
        return
    if c.more is not None:
        left = float(np.sqrt(max(used**2 - here**2, 0.0) + c.more.anywhere**2))
        yield _Step(f"Measure {c.more.poses} more poses: edbb plan --after", left, c.more.minutes, "")
    if parts is None:
        return
    left = _without(parts.unseen, used, r)
    one_fixture = c.run.readings.length is not None and len(c.run.places) == 1
    if parts.unseen > max(parts.seen, parts.misfit):
        if one_fixture:
            yield _Step("Measure from a second fixture: edbb plan --fixtures 2", left, minutes(c.n_groups))
        else:
            yield _Step("Measure poses in parts of the workspace that the run leaves out", left, minutes(20))
    if drift_counts(parts):
        warm = "Measure once the arm is warm, or log temperature_degC"
        yield _Step(warm, _without(parts.drift, used, r), None)
    if misfit_counts(parts) and (place := r.misfit_place) is not None:
        where = f"with {', '.join(x.text for x in place.ranges)}" if place.ranges else "between those of this run"
        yield _Step(f"Measure 20 poses {where}", _without(parts.misfit, used, r), minutes(20))


def _without(part: float, used: float, r: Release) -> float:
    """Return what is left of ``used`` without a part of it, at best as much as at poses like those measured [m]."""
    return float(max(np.sqrt(max(used**2 - part**2, 0.0)), r.where_measured or 0.0))


def _span(before: float, after: float, step: _Step) -> str:
    """``about 8 min, 0.52 mm → 0.44 mm at best``: what 95 of 100 targets stay within."""
    time = "" if step.minutes is None else f"about {max(step.minutes, 1.0):.0f} min, "
    return f"{time}{bound_text(before)} → {bound_text(after)}{step.how}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
