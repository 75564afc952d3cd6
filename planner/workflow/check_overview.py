"""What the screen says of a planned check."""

from planner.common.numbers import number_of
from planner.common.summary import Summary
from planner.instruments.check.results import CheckForecast
from planner.session.plan_types import Plan
from planner.workflow.plan_overview import plan_overview

MOST_SHOWN = 4  # changes that a check shows, which are listed


def check_overview(plan: Plan, forecast: CheckForecast) -> Summary:
    """Return what is said of a planned check: what is driven, and from which size on it shows each change."""
    whole = plan_overview(plan)
    facts, shown = [f for f in whole.facts if f[0] != plan.choice.index], forecast.facts()
    first, rest = shown[:MOST_SHOWN], shown[MOST_SHOWN:-1]
    more = [("", f"and {number_of(len(rest), 'change')} more")] if rest else []
    hidden = (forecast.hidden_because,) if forecast.hidden else ()
    details = [f for f in whole.details if f[0] != plan.choice.index]
    return Summary(whole.title, [*facts, *first, *more, shown[-1]], [*details, *rest], (*whole.notes, *hidden))
