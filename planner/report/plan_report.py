"""The report of a plan."""

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

import planner.report.formatting as text
import planner.report.plan_charts as plan_charts
from planner.cell.cell import Cell
from planner.common.numbers import number_of
from planner.common.summary import Aside, count_alike, name_first
from planner.common.units import to_deg, to_mm
from planner.design.observability.information import INDEX_RULES
from planner.model.use_text import bound_text
from planner.report.cell_view import build_cell_view
from planner.report.mounting import mounting_details, mounting_drawings, mounting_steps
from planner.report.page import Report, Row
from planner.report.plan_data import ParameterForecast, forecast_parameters, sample_drive, tour_orders
from planner.session.plan_types import Drive, Plan
from planner.session.plan_verdict import PlanVerdict, judge_plan
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
    visits = [(v, plan.cell.gauge.visit_cells(plan.cell, v)) for d in plan.drives for v in d.visits]
    content = {
        "plan": plan,
        "title": f"{'Session plan' if forecast is None else forecast.title} for {plan.cell.robot.title}",
        "about": f"{_cell_name(plan)}{plan.cell.gauge.describe(plan.cell)}",
        "verdict": _verdict(plan, forecast),
        "drive": _drive_text(plan),
        "first_drive": _first_drive_text(plan),
        "unseen": _unseen(plan),
        "steps": mounting_steps(plan),
        "drawings": mounting_drawings(plan),
        "mounting": mounting_details(plan),
        "asked": count_alike(n for n in plan.notes if not isinstance(n, Aside)),
        "asides": [n for n in plan.notes if isinstance(n, Aside)],
        "certificate": text.certificate_text(plan) if forecast is None else (),
        "forecast": forecast,
        "separation": text.separation_text(plan.separation) if plan.separation else "",
        "drives": drives,
        "forecasts": [_forecast(f) for f in forecasts],
        "rules": INDEX_RULES,
        "visits": visits,
        "places": any(where for _, (where, _) in visits),
        "figures": any(figure for _, (_, figure) in visits),
    }
    charts = (*ahead, *overview, *(c for d in drives for c in d["charts"]))
    return Report("plan.html.j2", content, charts, build_cell_view(plan))


def _verdict(plan: Plan, forecast: Forecast | None) -> PlanVerdict:
    """Say what the plan is good for; of one that does not calibrate, what it is for."""
    if forecast is None:
        return judge_plan(plan)
    return PlanVerdict(None, forecast.purpose.removesuffix("."), "", ())


def _drive_text(plan: Plan) -> str:
    """Say how long it takes, for how many poses, and how safe the path is."""
    minutes = sum(d.trajectory.duration_s for d in plan.drives) / 60
    roles = [v.role for d in plan.drives for v in d.visits]
    more = ", ".join(f"{n} to {r}" for r in ("repeat", "validate") if (n := roles.count(r)))
    poses = f"{number_of(len(plan.choice.q), 'pose')}{f', {more}' if more else ''}"
    _, gap, proven = text.clearance_fact([v for d in plan.drives for v in d.verdicts], plan.cell)
    path = f"The nominal robot collides nowhere: nearest bodies {gap} apart, {proven}."
    return f"{minutes:.0f} minutes of driving, {poses}. {path}"


def _first_drive_text(plan: Plan) -> str:
    """Say that the first drive may collide, where robot and fixture may be farther off than the path is clear."""
    if plan.targets is None:
        return ""
    off = plan.targets.before + max((f.room for f in plan.cell.fixtures), default=0.0)
    if off < min(d.clearance for d in plan.drives):
        return ""
    return (
        f"Uncalibrated, robot and fixture may be {bound_text(off)} off: the first drive may collide. Drive "
        "slowly, a hand on the stop."
    )


def _cell_name(plan: Plan) -> str:
    """Return what the cell is called, if it is called anything but that."""
    return "" if plan.cell.name == "cell" else f"cell {plan.cell.name} · "


def _unseen(plan: Plan) -> tuple[str, str] | None:
    """Return which parameters these poses do not show, and how many they are."""
    seen = plan.choice.seen
    if not seen.dropped:
        return None
    count = f"{len(seen.dropped)} of {len(seen.dropped) + len(seen.names)} parameters"
    counted = "" if plan.forecast is None else "; the expected error includes them"
    return f"These poses do not show {name_first([d.name for d in seen.dropped])}", f"{count}{counted}"


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
