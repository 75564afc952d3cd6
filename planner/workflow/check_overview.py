"""What the screen says of a planned check."""

from planner.checks.results import CheckForecast
from planner.common.summary import Summary, cut_facts
from planner.session.plan_types import Plan
from planner.workflow.plan_overview import plan_overview


def check_overview(plan: Plan, forecast: CheckForecast) -> Summary:
    """Return the overview of a planned check: the drive, and the size from which on it shows each change."""
    whole = plan_overview(plan)
    facts = [f for f in whole.facts if f[0] != plan.choice.index]
    *changes, rates = forecast.facts()
    most = 3  # changes that a check shows, which are listed
    hidden = (forecast.hidden_because,) if forecast.hidden else ()
    details = [f for f in whole.details if f[0] != plan.choice.index]
    drive, *others = facts
    first, more = cut_facts(changes, most), changes[most:]
    return Summary(whole.title, [drive, *first, rates, *others], [*details, *more], (*whole.notes, *hidden))
