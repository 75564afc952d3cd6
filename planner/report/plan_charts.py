"""Charts of a plan: choice of the poses, tour, joints, bar and speeds."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.common.numbers import number_of
from planner.common.units import Array, to_deg, to_mm
from planner.design.bayesian_design import BayesianDesign
from planner.design.foresight_text import describe_numbers_of_poses
from planner.design.observability.information import INDEX_RULES
from planner.design.selection.index_search import IndexCurve
from planner.report.chart import (
    BLUE,
    GREEN,
    GREY,
    JOINTS,
    ORANGE,
    RED,
    ROLES,
    Chart,
    Panel,
    ReferenceLine,
    Series,
    Span,
    joint_series,
    list_panel,
    share_panel,
)
from planner.report.formatting import count_text, digits, duration_text
from planner.report.plan_data import DrivenPath, ParameterForecast, TourOrders, angle_label
from planner.session.plan_types import Drive, Plan


def index_chart(plan: Plan, curve: IndexCurve) -> Chart:
    """Index against the number of poses, with the bound that no set of candidates can beat."""
    choice = plan.choice
    rule, n = INDEX_RULES[choice.index], len(choice.q)
    sizes, values, bounds = (np.asarray(v, float) for v in (curve.sizes, curve.values, curve.bounds))
    hover = tuple(f"{int(k)} poses: {v:.4g}, bound {b:.4g}" for k, v, b in zip(sizes, values, bounds, strict=True))
    series = [
        Series("chosen from the candidates", sizes, values, BLUE, hover=hover),
        Series("bound of the candidates", sizes, bounds, GREY, dashed=True),
        _this_plan(n, choice.value, f"{n} poses: {choice.value:.4g}"),
    ]
    if choice.pruning is not None:
        left = choice.pruning.left
        each = tuple(f"{k} poses: {v:.4g}" for k, v in zip(left.sizes.tolist(), left.values, strict=True))
        series[0] = replace(series[0], name="exchange")
        series[1:1] = [
            Series("pruning, one pose at a time", left.sizes.astype(float), left.values, ORANGE, hover=each),
            Series(f"exchange, {n} poses", np.array([n]), np.array([choice.pruning.exchanged]), BLUE, "points"),
        ]
    if choice.value != choice.on_grid_value:
        limit = np.array([plan.certificate.value])
        series.append(Series("bound with its moved poses", np.array([n]), limit, GREY, "points"))
    # 40: letters of a label that stand beside an axis
    label = f"{choice.index}, {rule.of_raw}" if len(rule.of_raw) < 40 else f"{choice.index} (m, rad)"
    every = np.concatenate([s.y for s in series])
    span = _span(every[np.isfinite(every)], 0.08, 1e-9)
    better = "higher" if rule.maximise else "lower"
    more = "" if choice.ball is None else " The plan shares its poses evenly between the balls, the curve does not."
    if choice.pruning:
        more = f" Pruning bends at {choice.pruning.left.knee} poses."
    return Chart(
        "index_curve",
        "How many poses are worth measuring",
        f"{choice.index} ({rule.of_raw}; {better} is better) of the best set found for each number of poses. "
        "No set of the candidates can cross the dashed line; poses moved off the grid have a bound of their own. "
        f"The flatter the curve, the less a further pose brings.{more}",
        (Panel("", "number of poses", label, tuple(series), y_range=span),),
    )


def expected_error_chart(expected: BayesianDesign) -> Chart:
    """Error of the tool that is expected after each number of poses."""
    n = np.arange(1.0, len(expected.after) + 1)
    hover = tuple(f"{int(k)} poses: {to_mm(e):.3f} mm" for k, e in zip(n, expected.after, strict=True))
    by_number = [f for f in expected.by_number if f.poses != len(n)]
    others, errors = np.array([float(f.poses) for f in by_number]), to_mm(np.array([f.error for f in by_number]))
    times = tuple(f"{f.poses} poses: {to_mm(f.error):.3f} mm, about {f.minutes or 0:.0f} min" for f in by_number)
    series = (
        Series("expected once causes are found", n, to_mm(expected.after), BLUE, hover=hover),
        Series("other numbers of poses", others, errors, ORANGE, "points", hover=times),
        _this_plan(len(n), float(to_mm(expected.left)), f"{to_mm(expected.left):.3f} mm"),
    )
    untraced, bound = (float(to_mm(v)) for v in (expected.unknown.untraced_error, expected.bound))
    limits = (
        ReferenceLine(untraced, expected.unknown.untraced_label),
        ReferenceLine(bound, f"no {len(n)} candidates leave less", below=True),
    )
    # 30: poses, before which errors are off the picture
    top = 1.5 * max(untraced, float(to_mm(expected.after[min(len(n), 30) - 1])))
    caption = (
        "The error as the poses of this plan are added. Plans of their own for other numbers would leave about: "
        f"{describe_numbers_of_poses(expected)}."
    )
    # 1.35: times the largest number of poses: the lines' labels stand beside the points
    wide = 1.35 * max([len(n), *(f.poses for f in by_number)])
    labels = ("", "number of poses", "error of the tool (mm rms)")
    panel = Panel(*labels, series, limits, x_range=(0.0, wide), y_range=(0.0, top))
    return Chart("foresight", "What the robot's error would be", caption, (panel,))


def _this_plan(n: int, value: float, hover: str) -> Series:
    return Series(f"this plan: {number_of(n, 'pose')}", np.array([n]), np.array([value]), RED, "points", hover=(hover,))


def funnel_chart(plan: Plan) -> Chart:
    """What each filter leaves of the sampled states."""
    counts = [float(v) for v in asdict(plan.pool.funnel).values()]
    texts = [count_text(counts[0])]
    texts += [f"{count_text(v)}, {digits(100 * v / u if u else 0.0)} % pass" for u, v in pairwise(counts)]
    bars = Series("", np.array(counts), np.arange(len(counts), dtype=float), BLUE, "bars", texts=tuple(texts))
    span = (1.0, 10.0 ** (np.ceil(np.log10(max(counts[0], 10.0))) + 2))
    panel = list_panel(
        "", "states that are left (logarithmic scale)", plan.pool.funnel.names, [bars], 38, log_x=True, x_range=span
    )
    caption = (
        f"{count_text(len(plan.pool))} candidates are kept of the states that pass every filter; "
        "the percentage is the part of the row above that passes."
    )
    return Chart("funnel", "From sampled states to candidate poses", caption, (panel,))


def parameter_chart(rows: tuple[ParameterForecast, ...]) -> Chart:
    """Predicted standard deviation of each parameter as a part of its prior sigma."""
    order = sorted(rows, key=lambda r: r.share)
    share, names = np.array([r.share for r in order]), [r.parameter.name for r in order]
    hover = [f"{r.parameter.name}, {r.parameter.what}: {r.share:.3g} of the prior sigma" for r in order]
    span = (10.0 ** np.floor(np.log10(share.min())), 10.0 ** np.ceil(np.log10(max(2.0, share.max() * 1.2))))
    label = "predicted standard deviation / prior sigma"
    caption = "Left is well known after the measurement; a parameter at the dotted line stays as uncertain as it was."
    panel = share_panel("", label, names, share, hover, GREEN, span, row=19.5)
    return Chart("parameters", "What the poses teach", caption, (panel,))


def tour_chart(both: TourOrders) -> Chart:
    """Joint angles over the poses, in the order of selection and in the order of the tour."""
    axes: dict[str, Any] = {"x_range": (0.0, float(both.unsorted_t[-1])), "y_range": _angle_span(both.unsorted_q)}
    panels = []
    for name, t, q in (("Unsorted", both.unsorted_t, both.unsorted_q), ("Sorted", both.sorted_t, both.sorted_q)):
        title = f"{name}: segments of {duration_text(float(t[-1]))}"
        label = "time by the cost of the segments (s)"
        panels.append(Panel(title, label, both.angle_label, joint_series(t, to_deg(q)), **axes))
    caption = (
        "The same poses on the same scale; unsorted is the order of selection. A segment lasts as long as its slowest "
        f"limit: {both.cost_name}."
    )
    return Chart("tour", "The tour, before and after sorting", caption, tuple(panels))


def joint_chart(cell: Cell, way: DrivenPath) -> Chart:
    """Draw the joint angles over the time of the drive."""
    series, span = joint_series(way.motion.t, to_deg(way.motion.q)), _angle_span(way.motion.q)
    panel = _over_time(way, "", angle_label(cell.robot), series, span, height=330)
    return Chart("joints", "Joint angles as driven", _way_text(way), (panel,))


def _over_time(way: DrivenPath, title: str, label: str, series: Sequence[Series], y_range: Span, **more: Any) -> Panel:
    """Axes over the time of the way there, with room for a point at either end."""
    x_range = -0.008 * way.ends, 1.008 * way.ends
    return Panel(title, "time (s)", label, tuple(series), x_range=x_range, y_range=y_range, **more)


def bar_chart(cell: Cell, way: DrivenPath, drive: Drive) -> Chart:
    """Draw the bar's length and its tilt in both ball joints, with the limits of each."""
    g, t = cell.gauge, way.motion.t
    low, high = float(to_mm(g.length_min)), float(to_mm(g.length_max))
    pad = 0.12 * (high - low)
    lines = (Series("", t, to_mm(way.length), "#555555"), *_visits(way, drive))
    ends = (ReferenceLine(low, f"shortest, {low:g} mm", below=True), ReferenceLine(high, f"longest, {high:g} mm"))
    title, label, span = f"Length of the {g.noun}", f"{g.noun} length (mm)", (low - pad, high + pad)
    length = _over_time(way, title, label, lines, span, limits=ends)
    panels = (length,) if way.tilt is None else (length, _tilt_panel(cell, way, way.tilt))
    return Chart("bar", f"The {g.noun} along the path", f"Points are measuring poses. {_way_text(way)}", panels)


def _tilt_panel(cell: Cell, way: DrivenPath, tilt: Array) -> Panel:
    """Tilt (n, 2) [rad] in both ball joints, against what they allow."""
    g, names = cell.gauge, ("at the fixture", "at the tool")
    cones = sorted({float(to_deg(c)) for c in (g.cone_fixture, g.cone_map)})
    tilts = [Series(*s) for s in zip(names, (way.motion.t,) * 2, to_deg(tilt).T, (BLUE, ORANGE), strict=True)]
    largest = tuple(ReferenceLine(c, f"largest tilt, {c:g} deg") for c in cones)
    title, span = f"Tilt of the {g.noun} at its ends", (0.0, cones[-1] * 1.15)
    return _over_time(way, title, "tilt (deg)", tilts, span, limits=largest)


def contact_chart(cell: Cell, drive: Drive) -> Chart | None:
    """How far off centre the uncalibrated robot meets each ball, at most; only a head of indicators has that."""
    if all(v.contact is None for v in drive.visits):
        return None
    series = []
    for k, ball in enumerate(cell.balls):
        met = [(v, float(to_mm(v.contact))) for v in drive.visits if v.contact is not None and v.ball == k]
        id_, off = np.array([float(v.id) for v, _ in met]), np.array([mm for _, mm in met])
        hover = tuple(f"pose {v.id}, {v.role}: {mm:.2f} mm" for v, mm in met)
        series.append(Series(f"ball {ball.name}", id_, off, JOINTS[k % len(JOINTS)], "points", hover=hover))
    usable = float(to_mm(cell.gauge.indicators.usable))
    limit = (ReferenceLine(usable, f"indicators make contact within {usable:g} mm"),)
    labels = ("", "pose", "first contact off centre (mm)")
    caption = "95 % of robots as uncertain as this one meet the ball nearer to the centre than the point shows."
    panel = Panel(*labels, tuple(series), limit, y_range=(0.0, 1.25 * usable))
    return Chart("contact", "First contact of the uncalibrated robot", caption, (panel,))


def speed_chart(cell: Cell, way: DrivenPath, drive: Drive) -> Chart:
    """Speed of the tool point and of the joints against their limits, and the largest use of every limit."""
    t, limit, speed = way.motion.t, float(to_mm(cell.motion.tool_speed)), to_mm(way.motion.tool_speed)
    limits: tuple[ReferenceLine, ...] = ()
    title, caption = "Speed of the tool point", _way_text(way)
    if np.isfinite(drive.trajectory.tool_speed_limit).any():
        limits = (ReferenceLine(limit, ""),)
        title += f"; dotted: measuring speed, {limit:.3g} mm/s = {limit * 60:g} mm/min"
        if speed.max() > 1.01 * limit:
            most = f"{speed.max():.0f} mm/s"
            caption += f" Peaks up to {most} are moves between poses, to which the measuring speed does not apply."
    span = (0.0, 1.25 * max([float(speed.max()), *(line.at for line in limits)]))
    line = (Series("", t, speed, BLUE),)
    tool = _over_time(way, title, "speed (mm/s)", line, span, limits=limits)
    lines, span = joint_series(t, 100 * way.share, width=1.1), (0.0, max(1.0, 115 * float(way.share.max())))
    joints = _over_time(way, "Speed of the joints", "part of its limit (%)", lines, span)
    return Chart("speeds", "Speeds against their limits", caption, (tool, joints, _limit_use(drive)))


def _limit_use(drive: Drive) -> Panel:
    """Largest use of each joint's limits over the whole drive, both ways, on dense samples."""
    names = [f"joint {j + 1}" for j in range(len(drive.limits.speed))]
    series = []
    for kind, colour in zip(("speed", "acceleration", "jerk"), JOINTS, strict=False):
        use = 100 * getattr(drive.limits, kind)
        hover = tuple(f"{n} {kind}: {u:.1f} %" for n, u in zip(names, use, strict=True))
        series.append(Series(kind, use, np.arange(len(names), dtype=float), colour, "points", hover=hover))
    limit = (ReferenceLine(100.0, "limit", upright=True),)
    title = "Largest use of every limit, the whole drive"
    return list_panel(title, "part of the limit (%)", names, series, limits=limit, x_range=(0.0, 112.0))


def _visits(way: DrivenPath, drive: Drive) -> list[Series]:
    """The visits as points, one series a role."""
    roles = np.array([v.role for v in drive.visits])
    out = []
    for role in [r for r in ROLES if (roles == r).any()]:
        at = np.flatnonzero(roles == role)
        hover = tuple(
            f"pose {drive.visits[k].id}, {role}: {to_mm(way.passed_length[k]):.1f} mm at {way.passed[k]:.1f} s"
            for k in at
        )
        out.append(Series(role, way.passed[at], to_mm(way.passed_length[at]), ROLES[role], "points", hover=hover))
    return out


def _angle_span(q: Array) -> Span:
    return _span(to_deg(q), 0.06, 1.0)


def _span(values: Array, share: float, least: float) -> Span:
    """Range of the values with room at either end: a share of it and at least so much."""
    pad = share * float(np.ptp(values)) + least
    return float(values.min()) - pad, float(values.max()) + pad


def _way_text(way: DrivenPath) -> str:
    text = f"From the mount pose through all poses to the mount pose again, {duration_text(way.ends)}"
    return f"{text}; then the same path is driven back." if way.returns else f"{text}."
