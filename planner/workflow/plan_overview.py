"""What the screen says of a plan: what is driven, the error before and after, what would help, what stays unseen."""

from collections.abc import Iterator, Sequence

from planner.common.numbers import number_of
from planner.common.summary import Fact, Summary, name_first, under_key
from planner.common.units import to_mm
from planner.design.expected_errors import ErrorByNumber, ErrorForecast
from planner.design.foresight_text import describe_forecast, describe_goal
from planner.design.observability.identifiability import DroppedParameter
from planner.design.observability.information import INDEX_RULES
from planner.design.pose_selection import describe_pruning
from planner.model.use_text import bound_text
from planner.motion.collision.body_gaps import clearance_text
from planner.session.plan_record import UnprovenPoses
from planner.session.plan_types import Plan
from planner.session.plan_verdict import PlanVerdict, judge_plan
from planner.session.tour_cost import cost_name


def plan_overview(plan: Plan) -> Summary:
    """Return the overview of a session of poses."""
    roles = [v.role for d in plan.drives for v in d.visits]
    minutes = sum(d.trajectory.duration_s for d in plan.drives) / 60
    said = plan.separation.texts() if plan.separation else ()
    verdict = judge_plan(plan)
    driven = "; ".join(filter(None, (f"{minutes:.0f} min", plan.reading_share)))
    return Summary(
        f"{plan.cell.name}: {_numbers_of_poses(plan, roles)}, plan {plan.plan_id}",
        [
            *_verdict_facts(plan, verdict),
            *(("tells apart", text) for text in said[:1]),
            ("drive", f"{driven}; {clearance_text(plan.cell, min(d.clearance for d in plan.drives))}"),
            *_change_facts(verdict),
            *(() if plan.expected_error else _index_facts(plan)),
            *_unseen_facts(plan.choice.seen.dropped, len(plan.choice.seen.names)),
        ],
        [*(_error_facts(plan.forecast) if plan.forecast else ()), *_details(plan, said)],
        plan.notes,
    )


def _numbers_of_poses(plan: Plan, roles: Sequence[str]) -> str:
    """Say what the poses are for, and how many are measured beside those that calibrate."""
    if "calibrate" not in roles:
        return f"{number_of(len(plan.choice.q), 'pose')} that validate a robot, none that calibrates (--poses N does)"
    more = roles.count("validate")
    validating = f" and {more} to validate" if more else ""
    seen = plan.choice.seen
    of = f" of {len(seen.names) + len(seen.dropped)}" if seen.dropped else ""
    return f"{number_of(len(plan.choice.q), 'pose')} to fit {seen.rank}{of} parameters{validating}"


def _verdict_facts(plan: Plan, verdict: PlanVerdict) -> Iterator[Fact]:
    """Say what the plan is good for, and how likely the error that was asked for is reached."""
    if plan.forecast is None:
        return
    of = ""
    if (targets := plan.targets) is not None:
        stated = "" if targets.tolerance is None else f": 95 of 100 targets within {bound_text(targets.within)}"
        of = f"{stated} (95 % sure)"
    yield "verdict", f"{verdict.headline}{of}"
    if plan.expected_error is not None and (goal := describe_goal(plan.expected_error)):
        yield "goal", goal


def _change_facts(verdict: PlanVerdict) -> Iterator[Fact]:
    """Say what would make it better or quicker."""
    for what, brings in verdict.changes:
        key, _, change = what.partition(": ")
        yield key.split()[-1].lower(), f"{change}: {brings}{' (hardly)' if key.startswith('Hardly') else ''}"


def _error_facts(expected: ErrorForecast) -> Iterator[Fact]:
    """Say the error of the tool before and after."""
    before, left, at_most = (f"{float(to_mm(v)):.3f} mm" for v in (expected.before, expected.left, expected.at_most))
    yield "error now", f"{before}  of the tool, rms {expected.unknown.where}, {expected.unknown.before_label}"
    yield "error after", f"{left}  95 % sure below {at_most}"


def _number_text(f: ErrorByNumber) -> str:
    minutes = "" if f.minutes is None else f", about {f.minutes:.0f} min"
    return f"{float(to_mm(f.error)):.3f} mm  with --poses {f.poses}{minutes}"


def _index_facts(plan: Plan) -> Iterator[Fact]:
    """Say the index of the poses, and how near to the best possible that is."""
    choice = plan.choice
    rule, bound = INDEX_RULES[choice.index], plan.certificate
    if told := describe_pruning(choice):
        yield choice.index, told
        return
    if not plan.by_index:
        yield choice.index, f"{choice.value:#.4g}, {rule.of_raw}; it did not choose the poses"
        return
    gap = 100 * max(rule.gap(choice.value, bound.value), 0.0)
    yield choice.index, f"{choice.value:#.4g} in m, rad; at most {gap:.1f} % from the best possible"


def _unseen_facts(dropped: Sequence[DroppedParameter], seen: int) -> Iterator[Fact]:
    """One parameter with its reason, of several the names: the page has the reasons."""
    if len(dropped) == 1:
        yield "unseen", f"{dropped[0].name}: {dropped[0].because}"
    elif dropped:
        names = name_first([d.name for d in dropped])
        yield "unseen", f"{len(dropped)} of {seen + len(dropped)} parameters: {names} (why: report.html)"


def _details(plan: Plan, said: Sequence[str]) -> Iterator[Fact]:
    choice, drives = plan.choice, plan.drives
    yield "candidates", plan.pool.funnel.text()
    if plan.forecast is not None:
        yield from under_key("rms", [_number_text(f) for f in plan.forecast.by_number])
    if (expected := plan.expected_error) is not None:
        yield "expected", describe_forecast(expected)
        yield "all poses", f"{float(to_mm(expected.floor)):.3f} mm would be left by all candidates together"
    yield choice.index, INDEX_RULES[choice.index].of_raw
    yield choice.index, _proof_text(plan)
    tour_s, unsorted_s = sum(d.tour.cost_s for d in drives), sum(d.tour.unsorted_s for d in drives)
    shortest = "proven shortest" if all(d.tour.optimal for d in drives) else "not proven shortest"
    yield "order", f"{unsorted_s:.0f} s as chosen, {tour_s:.0f} s in order ({shortest} by {cost_name(plan.cell)})"
    yield from (("tells apart", text) for text in said[1:])


def _proof_text(plan: Plan) -> str:
    """Say the index and its bounds among the candidates and off them."""
    choice, off = plan.choice, plan.certificate.value
    gap, bound = INDEX_RULES[choice.index].gap, choice.certificate.value
    if not plan.by_index:
        return f"{choice.value:#.4g}; no set of the candidates does better than {bound:#.4g}"
    moved = f"; with the poses moved off the candidates {off:#.4g}, gap {100 * max(gap(choice.value, off), 0.0):.1f} %"
    return (
        f"{choice.value:#.4g}; no set of the candidates does better than {bound:#.4g} (chosen among "
        f"them: {choice.on_grid_value:#.4g}, gap {100 * gap(choice.on_grid_value, bound):.1f} %"
        f"{moved if off != bound else ''})"
    )


def unproven_overview(found: UnprovenPoses) -> Summary:
    """Return the overview of poses that a time limit left without a path."""
    choice, bound = found.choice, found.certificate
    rule = INDEX_RULES[choice.index]
    gap, passes = 100 * max(rule.gap(choice.value, bound.value), 0.0), "exceeds" if rule.maximise else "falls below"
    return Summary(
        f"{found.cell.name}: {number_of(len(choice.q), 'pose')} for {number_of(choice.seen.rank, 'parameter')}, "
        "no path proven, no program",
        [
            ("not proven", found.why),
            (
                choice.index,
                f"{choice.value:#.4g} in m, rad; no set of these {passes} {bound.value:#.4g}, gap {gap:.1f} %",
            ),
        ],
        [("candidates", found.pool.funnel.text())],
        found.notes,
    )
