"""What the screen says of a planned check."""

from planner.common.summary import Summary
from planner.instruments.check.results import CheckForecast
from planner.session.plan_types import Plan
from planner.workflow.plan_overview import plan_overview


def check_overview(plan: Plan, forecast: CheckForecast) -> Summary:
    """Return what is said of a planned check: what is driven, and from which size on it shows each change."""
    whole = plan_overview(plan)
    facts, shown = [f for f in whole.facts if f[0] != plan.choice.index], forecast.facts()
    most = 3  # changes that a check shows, which are listed
    first, rest = shown[:most], shown[most:-1]
    if rest:
        key, text = first[-1]
        first[-1] = key, f"{text}; {len(rest)} more: -v"
    hidden = (forecast.hidden_because,) if forecast.hidden else ()
    details = [f for f in whole.details if f[0] != plan.choice.index]
    drive, *others = facts
    return Summary(whole.title, [drive, *first, shown[-1], *others], [*details, *rest], (*whole.notes, *hidden))
