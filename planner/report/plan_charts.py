"""Charts of a plan: choice of the poses, tour, joints, bar and speeds."""

from dataclasses import asdict
from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, to_deg, to_mm
from planner.design.bayesian_design import BayesianDesign, describe_bayesian_design
from planner.design.observability.information import INDEX_RULES
from planner.report.chart import BLUE, GREEN, GREY, JOINTS, ORANGE, RED, ROLES, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import FILTERS, count_text, duration_text, significant_text
from planner.report.plan_data import DrivenPath, ParameterForecast, TourOrders
from planner.session.plan_types import Drive, Plan

ROW_PX = 26  # [px] of one name in a list
FEW_POSES = 30  # poses, before which errors are off the picture
SHORT_LABEL = 40  # letters of a label that stand beside an axis


def index_chart(plan: Plan) -> Chart:
    """Index against the number of poses, with the bound that no set of candidates can beat."""
    choice, curve = plan.choice, plan.curve
    rule, n = INDEX_RULES[choice.index], len(choice.q)
    sizes, values, bounds = (np.asarray(v, float) for v in (curve.sizes, curve.values, curve.bounds))
    hover = tuple(f"{int(k)} poses: {v:.4g}, bound {b:.4g}" for k, v, b in zip(sizes, values, bounds, strict=True))
    series = [
        Series("chosen from the candidates", sizes, values, BLUE, hover=hover),
        Series("proven bound", sizes, bounds, GREY, dashed=True),
        Series(
            f"this plan: {n} poses",
            np.array([n]),
            np.array([choice.value]),
            RED,
            "points",
            hover=(f"{n} poses: {choice.value:.4g}",),
        ),
    ]
    panel = Panel(
        "",
        "number of poses",
        f"{choice.index}, {rule.what}" if len(rule.what) < SHORT_LABEL else choice.index,
        tuple(series),
        y_range=_room(values, bounds, choice.value),
    )
    better = "higher" if rule.maximise else "lower"
    shared = "" if choice.ball is None else " The plan shares its poses evenly between the balls, the curve does not."
    return Chart(
        "index_curve",
        "How many poses are worth measuring",
        f"{choice.index} ({rule.what}; {better} is better) of the best set found for each number of poses. "
        "No set of the candidates can cross the dashed line, poses moved off the grid can. "
        f"The flatter the curve, the less a further pose brings.{shared}",
        (panel,),
    )


def foreseen_error_chart(ahead: BayesianDesign) -> Chart:
    """Error of the tool that is expected after each number of poses."""
    n = np.arange(1.0, len(ahead.after) + 1)
    hover = tuple(f"{int(k)} poses: {to_mm(e):.3f} mm" for k, e in zip(n, ahead.after, strict=True))
    series = [
        Series("expected once the run is traced", n, to_mm(ahead.after), BLUE, hover=hover),
        Series(
            f"this plan: {len(n)} poses",
            n[-1:],
            np.array([float(to_mm(ahead.left))]),
            RED,
            "points",
            hover=(f"{to_mm(ahead.left):.3f} mm",),
        ),
    ]
    untraced = float(to_mm(ahead.unknown.untraced))
    bound = ReferenceLine(float(to_mm(ahead.bound)), f"no {len(n)} poses leave less", below=True)
    limits = (ReferenceLine(untraced, "geometry alone"), bound)
    top = 1.5 * max(untraced, float(to_mm(ahead.after[min(len(n), FEW_POSES) - 1])))
    panel = Panel("", "number of poses", "error of the tool (mm rms)", tuple(series), limits, y_range=(0.0, top))
    return Chart(
        "foresight",
        "What the robot's error would be",
        f"As the poses of this plan are added: {describe_bayesian_design(ahead)}.",
        (panel,),
    )


def _room(values: np.ndarray, bounds: np.ndarray, value: float) -> tuple[float, float]:
    both = np.concatenate([values, bounds, [value]])
    both = both[np.isfinite(both)]
    pad = 0.08 * float(np.ptp(both)) + 1e-9
    return float(both.min()) - pad, float(both.max()) + pad


def funnel_chart(plan: Plan) -> Chart:
    """What each filter leaves of the sampled states."""
    counts = [float(v) for v in asdict(plan.pool.funnel).values()]
    texts = [count_text(counts[0])]
    texts += [f"{count_text(v)}   {significant_text(100 * v / u if u else 0.0)} % pass" for u, v in pairwise(counts)]
    bars = Series("", np.array(counts), np.arange(len(counts), dtype=float), BLUE, "bars", texts=tuple(texts))
    panel = Panel(
        "",
        "states that are left (logarithmic scale)",
        "",
        (bars,),
        log_x=True,
        x_range=(1.0, 10.0 ** (np.ceil(np.log10(max(counts[0], 10.0))) + 2)),
        y_names=FILTERS if plan.cell.gauge.is_attached else plan.pool.funnel.names,
        height=ROW_PX * len(counts) + 20,
    )
    return Chart(
        "funnel",
        "From sampled states to candidate poses",
        f"{count_text(len(plan.pool))} candidates are kept of the states that pass every filter; "
        "the percentage is the part of the row above that passes.",
        (panel,),
    )


def parameter_chart(rows: tuple[ParameterForecast, ...]) -> Chart:
    """Predicted standard deviation of each parameter as a part of its prior size."""
    order = sorted(rows, key=lambda r: r.share)
    share, place = np.array([r.share for r in order]), np.arange(len(order), dtype=float)
    hover = tuple(f"{r.parameter.name}, {r.what}: {r.share:.3g} of the prior size" for r in order)
    points = Series("", share, place, GREEN, "points", hover=hover)
    low = 10.0 ** np.floor(np.log10(share.min()))
    panel = Panel(
        "",
        "predicted standard deviation / prior size",
        "",
        (points,),
        limits=(ReferenceLine(1.0, "prior size", upright=True),),
        log_x=True,
        x_range=(low, 10.0 ** np.ceil(np.log10(max(2.0, share.max() * 1.2)))),
        y_names=tuple(r.parameter.name for r in order),
        height=int(0.75 * ROW_PX * len(order)) + 30,
    )
    return Chart(
        "parameters",
        "What the poses teach",
        "Left is well known after the measurement; a parameter at the dotted line stays as uncertain as it was.",
        (panel,),
    )


TIME_LABEL = "time (s)"


def tour_chart(drive: Drive, both: TourOrders, suffix: str) -> Chart:
    """Joint angles over the poses, in the order of selection and in the order of the tour."""
    angles = to_deg(both.unsorted_q)
    scale = (0.0, float(both.unsorted_t[-1]))
    height = _span(angles)
    panels = [
        Panel(
            f"{name}: {duration_text(float(t[-1]))}",
            "time of the slowest axis (s)",
            "joint angle (deg)",
            _joints(t, q),
            x_range=scale,
            y_range=height,
        )
        for name, t, q in (
            ("In the order of selection", both.unsorted_t, both.unsorted_q),
            ("In the order of the tour", both.sorted_t, both.sorted_q),
        )
    ]
    return Chart(
        f"tour{suffix}",
        "The tour, before and after sorting",
        "The same poses on the same scale. A leg lasts as long as its slowest axis needs at full speed.",
        tuple(panels),
    )


def joint_chart(way: DrivenPath, drive: Drive, suffix: str) -> Chart:
    """Joint angles as driven."""
    angles = to_deg(way.motion.q)
    panel = Panel(
        "",
        TIME_LABEL,
        "joint angle (deg)",
        _joints(way.motion.t, way.motion.q),
        x_range=_time(way),
        y_range=_span(angles),
        height=330,
    )
    return Chart(f"joints{suffix}", "Joint angles as driven", _there(way), (panel,))


def bar_chart(cell: Cell, way: DrivenPath, drive: Drive, suffix: str) -> Chart:
    """Length of the bar, and its tilt in both ball joints, against what they allow."""
    g, t = cell.gauge, way.motion.t
    low, high = float(to_mm(g.length_min)), float(to_mm(g.length_max))
    pad = 0.12 * (high - low)
    length = Panel(
        "Length of the bar",
        TIME_LABEL,
        "bar length (mm)",
        (Series("", t, to_mm(way.length), "#555555"), *_visits(way, drive)),
        limits=(ReferenceLine(low, f"shortest, {low:g} mm", below=True), ReferenceLine(high, f"longest, {high:g} mm")),
        x_range=_time(way),
        y_range=(low - pad, high + pad),
    )
    cones = sorted({float(to_deg(c)) for c in (g.cone_fixture, g.cone_map)})
    tilt = Panel(
        "Tilt of the bar in its ball joints",
        TIME_LABEL,
        "tilt (deg)",
        tuple(
            Series(f"at the {place}", t, to_deg(angle), colour)
            for place, angle, colour in zip(("fixture", "tool"), way.tilt.T, (BLUE, ORANGE), strict=True)
        ),
        limits=tuple(ReferenceLine(c, f"largest tilt, {c:g} deg") for c in cones),
        x_range=_time(way),
        y_range=(0.0, cones[-1] * 1.15),
    )
    return Chart(f"bar{suffix}", "The bar along the way", f"Points are measuring poses. {_there(way)}", (length, tilt))


def contact_chart(cell: Cell, drive: Drive, suffix: str) -> Chart | None:
    """How far off centre the uncalibrated robot meets each ball, at most; only a head of indicators has that."""
    head = cell.gauge.head
    if head is None:
        return None
    at = [v for v in drive.visits if v.contact is not None]
    usable = float(to_mm(head.usable))
    series = [
        Series(
            f"ball {ball.name}",
            np.array([float(v.id) for v in at if v.ball == k]),
            np.array([float(to_mm(v.contact or 0.0)) for v in at if v.ball == k]),
            JOINTS[k % len(JOINTS)],
            "points",
            hover=tuple(f"pose {v.id}, {v.role}: {to_mm(v.contact or 0.0):.2f} mm" for v in at if v.ball == k),
        )
        for k, ball in enumerate(cell.balls)
    ]
    panel = Panel(
        "",
        "pose",
        "first contact off centre (mm)",
        tuple(series),
        limits=(ReferenceLine(usable, f"indicators make contact within {usable:g} mm"),),
        y_range=(0.0, 1.25 * usable),
    )
    return Chart(
        f"contact{suffix}",
        "First contact of the uncalibrated robot",
        "95 % of robots as uncertain as this one meet the ball nearer to the centre than the point shows.",
        (panel,),
    )


def speed_chart(cell: Cell, way: DrivenPath, drive: Drive, suffix: str) -> Chart:
    """Speed of the tool point and of the joints against their limits, and the largest use of every limit."""
    t, limit = way.motion.t, float(to_mm(cell.motion.tool_speed))
    speed = to_mm(way.motion.tool_speed)
    limited = bool(np.isfinite(drive.trajectory.tool_speed_limit).any())
    tool = Panel(
        "Speed of the tool point",
        TIME_LABEL,
        "speed (mm/s)",
        (Series("", t, speed, BLUE),),
        limits=(ReferenceLine(limit, f"measuring speed, {limit:.3g} mm/s = {limit * 60:g} mm/min"),) if limited else (),
        x_range=_time(way),
        y_range=(0.0, 1.25 * max(limit if limited else 0.0, float(speed.max()))),
    )
    share = 100 * way.share
    axes = Panel(
        "Speed of the joints",
        TIME_LABEL,
        "part of its limit (%)",
        tuple(Series(f"joint {j + 1}", t, s, JOINTS[j % len(JOINTS)], width=1.1) for j, s in enumerate(share.T)),
        x_range=_time(way),
        y_range=(0.0, max(1.0, 1.15 * float(share.max()))),
    )
    return Chart(f"speeds{suffix}", "Speeds against their limits", _there(way), (tool, axes, _use(drive)))


def _use(drive: Drive) -> Panel:
    """Largest use of each joint's limits over the whole drive, both ways, on dense samples."""
    report = drive.limits
    names = [f"joint {j + 1}" for j in range(len(report.speed))]
    place = np.arange(len(names), dtype=float)
    kinds = (("speed", report.speed), ("acceleration", report.acceleration), ("jerk", report.jerk))
    return Panel(
        "Largest use of every limit, the whole drive",
        "part of the limit (%)",
        "",
        tuple(
            Series(
                f"{kind}",
                100 * use,
                place,
                JOINTS[k],
                "points",
                hover=tuple(f"{n} {kind}: {100 * u:.1f} %" for n, u in zip(names, use, strict=True)),
            )
            for k, (kind, use) in enumerate(kinds)
        ),
        limits=(ReferenceLine(100.0, "limit", upright=True),),
        x_range=(0.0, 112.0),
        y_names=tuple(names),
        height=26 * len(names) + 20,
    )


def _joints(t: Array, q: Array) -> tuple[Series, ...]:
    return tuple(Series(f"joint {j + 1}", t, a, JOINTS[j % len(JOINTS)]) for j, a in enumerate(to_deg(q).T))


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


def _time(way: DrivenPath) -> tuple[float, float]:
    """Room for a point at either end."""
    return -0.008 * way.ends, 1.008 * way.ends


def _span(angles: Array) -> tuple[float, float]:
    pad = 0.06 * float(np.ptp(angles)) + 1.0
    return float(angles.min()) - pad, float(angles.max()) + pad


def _there(way: DrivenPath) -> str:
    text = f"From the mount pose through all poses to the mount pose again, {duration_text(way.ends)}"
    return f"{text}; then the same way is driven back." if way.returns else f"{text}."
