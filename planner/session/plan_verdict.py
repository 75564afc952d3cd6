"""What page and screen say of a plan first: whether it is good enough and for what, and what would make it better."""

from dataclasses import dataclass

from planner.common.units import to_mm
from planner.design.assumptions import LIMIT_QUANTILE
from planner.design.expected_errors import ErrorByNumber
from planner.design.foresight_text import another_place_pays, describe_goal
from planner.design.target_errors import TargetForecast
from planner.model.use_statement import UseAnswer
from planner.model.use_text import (
    TARGET,
    TOOLS,
    ask_for_tolerance,
    bound_text,
    share_text,
    targets_text,
    usual_uses_text,
)
from planner.session.plan_types import Plan


@dataclass(frozen=True)
class PlanVerdict:
    """What a plan is good for.

    Attributes:
        answer: whether such a robot will hold the tolerance of the cell; ``None`` where it states none.
        headline: the same as a title.
        because: what it rests on, in sentences; empty where nothing is foreseen.
        changes: what would make it better or quicker, and what that leaves.
    """

    answer: UseAnswer | None
    headline: str
    because: str
    changes: tuple[tuple[str, str], ...]


def judge_plan(plan: Plan) -> PlanVerdict:
    """Return what a plan that calibrates is good for, before anything is measured."""
    e, targets = plan.forecast, plan.targets
    goal = "" if plan.expected_error is None else describe_goal(plan.expected_error)
    goal = f" Rms over the workspace, {goal}." if goal else ""
    if e is None:
        validates = not any(v.role == "calibrate" for d in plan.drives for v in d.visits)
        said = "These poses validate a robot, they do not calibrate one" if validates else "No error is foreseen"
        return PlanVerdict(None, said, "--poses N calibrates." if validates else "", ())
    if targets is None:
        left, at_most = bound_text(e.left), bound_text(e.at_most)
        headline = f"Expected: tool error {left}, now {bound_text(e.before)}"
        because = f"Rms {e.unknown.where}; 95 % sure below {at_most}.{goal}"
        return PlanVerdict(None, headline, because, _changes(plan, 1.0))
    within = targets_text(targets.within, targets.before, "such robots")
    with_tool = f"with {TOOLS['measured']}"
    if targets.tolerance is None:
        answer, headline = None, f"Expected: {within}"
        uses, ask = usual_uses_text(targets.within, TOOLS["measured"]), "tolerance_mm under [use] in the cell"
        why = f"{uses} {ask_for_tolerance(ask)}"
        if targets.used != "measured":
            why = f"This is {with_tool}. For {TOOLS[targets.used]}, which will be used, nothing is foreseen."
        because = f"95 % sure for a robot of this kind. {why}"
    else:
        answer, headline = _answer(targets)
        many = share_text(targets.enough).capitalize()
        because = f"Expected {with_tool}, 95 % sure: {within}. {many} of the robots of this kind hold the tolerance."
    return PlanVerdict(answer, headline, f"{because} {TARGET}{goal}", _changes(plan, targets.within / e.left))


def _answer(targets: TargetForecast) -> tuple[UseAnswer, str]:
    """Return whether a tolerance will be held, by the share of robots that hold it, and the same as a title."""
    limit = f"{float(to_mm(targets.tolerance or 0.0)):g} mm"
    if targets.enough >= LIMIT_QUANTILE:
        return "yes", f"Foreseen: good enough for {limit}"
    if targets.enough <= 1 - LIMIT_QUANTILE:
        return "no", f"Foreseen: not good enough for {limit}"
    return "not known", f"Not known whether it will be good enough for {limit}"


def _changes(plan: Plan, times: float) -> tuple[tuple[str, str], ...]:
    """Return what would make a plan better or quicker; its errors count ``times``, to be in the headline's measure."""
    e, n = plan.forecast, len(plan.choice.q)
    assert e is not None
    hardly = 0.97  # of the error: what leaves more of it than this is not worth its minutes
    now = bound_text(times * e.left)
    more, quicker = [f for f in e.by_number if f.poses > n][-1:], [f for f in e.by_number[:1] if f.poses < n]
    out = [
        (
            f"{'Better' if f.error < hardly * e.left else 'Hardly better'}: --poses {f.poses}",
            f"{now} → {_number_text(f, times)}",
        )
        for f in more
    ]
    if (chosen := plan.expected_error) is not None and another_place_pays(chosen):
        floor = bound_text(times * chosen.floor)
        out.append(("Better: a second fixture, --fixtures 2", f"with one fixture never below {floor}"))
    return (*out, *((f"Quicker: --poses {f.poses}", f"{now} → {_number_text(f, times)}") for f in quicker))


def _number_text(f: ErrorByNumber, times: float) -> str:
    return bound_text(times * f.error) + ("" if f.minutes is None else f", about {f.minutes:.0f} min")
