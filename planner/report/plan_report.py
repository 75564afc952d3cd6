"""The report of a plan."""

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

import planner.report.formatting as text
import planner.report.plan_charts as plan_charts
from planner.cell.cell import Cell
from planner.cell.reading import gauge_class
from planner.common.summary import Aside, count_alike
from planner.common.units import to_deg, to_mm
from planner.design.foresight_text import describe_goal
from planner.design.observability.information import INDEX_RULES
from planner.report.cell_view import build_cell_view
from planner.report.page import Report, Row
from planner.report.plan_data import ParameterForecast, forecast_parameters, sample_drive, tour_orders
from planner.session.plan_types import Drive, Plan
from planner.session.tour_cost import cost_name


class Forecast(Protocol):
    """What a plan will tell that does not calibrate: the head of its page, and from which size on it shows what."""

    @property
    def title(self) -> str:
        """What such a plan is called."""

    @property
    def purpose(self) -> str:
        """What it is for, in a sentence."""

    @property
    def rates(self) -> str:
        """How surely it is found, and how often a sound robot gives an alarm."""

    def rows(self) -> list[tuple[str, str]]:
        """Return every change that shows, and from which motion of the tool on, in mm."""


def report_plan(plan: Plan, forecast: Forecast | None = None) -> Report:
    """Return the page of a plan and its pictures; ``forecast``: what it shows if it does not calibrate."""
    forecasts, drives = forecast_parameters(plan), [_drive(plan, k) for k in range(len(plan.drives))]
    overview = [plan_charts.funnel_chart(plan)]
    overview += [plan_charts.parameter_chart(forecasts)] if forecast is None else []
    ahead = [plan_charts.expected_error_chart(plan.expected_error)] if plan.expected_error else []
    ahead += [plan_charts.index_chart(plan, plan.curve)] if plan.curve else []
    content = {
        "plan": plan,
        "about": f"cell {plan.cell.name} · {plan.cell.gauge.describe(plan.cell)}",
        "facts": _facts(plan) if forecast is None else _facts_without_index(plan),
        "mounting": _mounting(plan),
        "reading": (plan.cell.gauge.reading_text(plan.cell.file),),
        "asked": count_alike(n for n in plan.notes if not isinstance(n, Aside)),
        "asides": [n for n in plan.notes if isinstance(n, Aside)],
        "certificate": text.certificate_text(plan) if forecast is None else (),
        "forecast": forecast,
        "separation": text.separation_text(plan.separation) if plan.separation else "",
        "drives": drives,
        "forecasts": [_forecast(f) for f in forecasts],
        "rules": INDEX_RULES,
        "visits": [v for d in plan.drives for v in d.visits],
    }
    charts = (*ahead, *overview, *(c for d in drives for c in d["charts"]))
    return Report("plan.html.j2", content, charts, build_cell_view(plan))


def _facts(plan: Plan) -> tuple[Row, ...]:
    """The handful of numbers that a person asks for first: (what, value, remark)."""
    choice, drives = plan.choice, plan.drives
    rule, bound = INDEX_RULES[choice.index], plan.certificate
    proof, sets = "proven" if bound.verified else "not proven", f"any {bound.poses}" if bound.poses else "any number"
    roles = [v.role for d in drives for v in d.visits]
    extra = ", ".join(f"{n} to {r}" for r in ("repeat", "validate") if (n := roles.count(r)))
    made = "calibrate" in roles
    what_for = f"to calibrate{f', {extra}' if extra else ''}" if made else "to validate, at random"
    free = len(choice.seen.names)
    gap = max(rule.gap(choice.value, bound.value), 0.0)
    beyond = f"at most {text.percent_text(gap)} from the bound" if plan.by_index else "did not choose the poses"
    index = (  # where it did not choose the poses, the text below says it
        (choice.index, text.digits(choice.value, 4), f"{rule.what}, {beyond}"),
        ("bound", text.bound_text(bound.value, rule.maximise), f"{proof} for {sets} candidates"),
    )
    driving, clearance = _drive_facts(plan)
    return (
        driving,
        ("poses", str(len(choice.q)), what_for),
        *_expected_error(plan),
        *(index if plan.expected_error is None else ()),
        clearance,
        ("parameters", f"{free} of {free + len(choice.seen.dropped)}", "can be told apart"),
    )


def _drive_facts(plan: Plan) -> tuple[Row, Row]:
    """How long it drives, and how far from everything."""
    driving, motion = sum(d.trajectory.duration_s for d in plan.drives), plan.cell.motion
    both = "both ways, " if motion.both_ways and motion.is_continuous else ""
    waits = f", {plan.reading_share}" if plan.reading_share else ""
    return (
        ("driving", text.duration_text(driving), f"{both}{motion.measure}{waits}"),
        text.clearance_fact([v for d in plan.drives for v in d.verdicts], plan.cell),
    )


def _mounting(plan: Plan) -> list[str]:
    """Say what a person sets up before the robot drives and where the program pauses; how long the gauge is there."""
    cell, gauge = plan.cell, plan.cell.gauge
    guide = gauge_class(cell.file).session_guide(cell.file)
    lengths = [(d, gauge.length_text(d.visits[0].length)) for d in plan.drives]
    starts = [f"At {gauge.session_names(cell, d.mounting)[0]} it is {length} long." for d, length in lengths if length]
    return [*(f"{step.title}. {step.text}" for step in (*guide.before, *guide.at_start)), *starts]


def _facts_without_index(plan: Plan) -> tuple[Row, ...]:
    """The same numbers of poses that no index has chosen."""
    return (("poses", str(len(plan.choice.q)), "to tell what has changed"), *_drive_facts(plan))


def _expected_error(plan: Plan) -> tuple[Row, ...]:
    """The error that the robot would keep, where the poses were chosen by that."""
    if plan.expected_error is None:
        return ()
    expected = plan.expected_error
    before, left, at_most = (f"{float(to_mm(v)):.3f} mm" for v in (expected.before, expected.left, expected.at_most))
    return (
        ("error now", before, f"of the tool, rms {expected.unknown.where}, {expected.unknown.before_label}"),
        ("error after", left, f"95 of 100 such robots below {at_most}"),
        *((("goal", *goal.split(": ")),) if (goal := describe_goal(expected)) else ()),
    )


def _tour_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What is known of the order: (what, value)."""
    tour, returns = drive.tour, len(drive.trajectory.waypoint_time) > len(drive.path.q)
    bound = f"no order is quicker than {text.duration_text(tour.lower_bound_s)}"
    proof = "proven: no order is quicker" if tour.optimal else bound
    return (
        ("solver", tour.solver),
        ("a segment costs the time of", cost_name(cell)),
        ("in the order of selection", text.duration_text(tour.unsorted_s)),
        ("in the order of the tour", f"{text.duration_text(tour.cost_s)} ({proof})"),
        ("as driven", f"{text.duration_text(drive.trajectory.duration_s)}{', both ways' if returns else ''}"),
        *_speed_facts(cell, drive),
    )


def _speed_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What tool and gauge do at most while the gauge is attached, against their limits: (what, value)."""
    used, gauge = drive.limits, cell.gauge
    if not np.isfinite(gauge.rate):
        return ()
    most, limit = used.reading_acceleration * gauge.acceleration, cell.motion.tool_speed
    rows = (
        ("tool speed at most", used.tool_speed * limit, limit, "mm/s"),
        ("rate of the gauge at most", used.reading_rate * gauge.rate, gauge.rate, "mm/s"),
        ("acceleration of the gauge at most", most, gauge.acceleration, "mm/s²"),
    )
    return tuple((what, f"{to_mm(value):.1f} of {to_mm(limit):g} {unit}") for what, value, limit, unit in rows)


def _path_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What is known of the path: (what, value)."""
    path, g = drive.path, cell.gauge
    direct, supports = sum(leg.direct for leg in path.legs), int((path.node < 0).sum())
    segments = f"{len(path.legs)}: {direct} straight in joint space, {len(path.legs) - direct} planned around something"
    return (
        ("segments", segments),
        ("support poses", str(supports)),
        *g.path_facts(path.length_min, path.length_max),
        *text.verdict_rows("measuring path", drive.verdicts[:2], cell),
        *text.verdict_rows(g.travel_name, drive.verdicts[2:], cell),
    )


def _forecast(f: ParameterForecast) -> Row:
    """Name, what it is, unit, prior sigma, standard deviation, their ratio."""
    p = f.parameter
    unit, to = ("mm", to_mm) if p.unit == "m" else (p.unit.replace("rad", "deg"), to_deg)
    prior, sigma = (text.digits(float(to(v))) for v in (p.prior, f.sigma))
    return (p.name, p.what, unit, prior, sigma, text.digits(f.share))


def _drive(plan: Plan, k: int) -> dict[str, Any]:
    """One fixture's drive in words, and its charts."""
    cell, drive = plan.cell, plan.drives[k]
    way, number = sample_drive(cell, drive), f"_{k + 1}" if len(plan.drives) > 1 else ""
    attached = cell.has_bar()
    drawn = (
        plan_charts.tour_chart(tour_orders(cell, drive)),
        plan_charts.joint_chart(cell, way),
        plan_charts.bar_chart(cell, way, drive) if attached else plan_charts.contact_chart(cell, drive),
        plan_charts.speed_chart(cell, way, drive),
    )
    charts = [replace(c, name=f"{c.name}{number}") for c in drawn if c]
    facts = {"tour": _tour_facts(cell, drive), "path": _path_facts(cell, drive)}
    return facts | {"fixture": cell.place_name(drive.mounting), "charts": charts}
