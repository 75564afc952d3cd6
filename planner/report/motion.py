"""Pictures of the motion: the tour before and after sorting, joints, bar and speeds over time."""

import numpy as np

from planner.cell import Cell
from planner.plan import Drive
from planner.report.data import Driven, Rounds
from planner.report.picture import BLUE, JOINTS, ORANGE, ROLES, Limit, Panel, Picture, Series
from planner.report.words import seconds
from planner.units import Array, to_deg, to_mm

SECONDS = "time (s)"


def tour(drive: Drive, both: Rounds, suffix: str) -> Picture:
    """Joint angles over the poses, in the order of selection and in the order of the tour."""
    angles = to_deg(both.unsorted_q)
    scale = (0.0, float(both.unsorted_t[-1]))
    height = _span(angles)
    panels = [
        Panel(
            f"{name}: {seconds(float(t[-1]))}",
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
    return Picture(
        f"tour{suffix}",
        "The tour, before and after sorting",
        "The same poses on the same scale. A leg lasts as long as its slowest axis needs at full speed.",
        tuple(panels),
    )


def joints(way: Driven, drive: Drive, suffix: str) -> Picture:
    """Joint angles as driven."""
    angles = to_deg(way.motion.q)
    panel = Panel(
        "",
        SECONDS,
        "joint angle (deg)",
        _joints(way.motion.t, way.motion.q),
        x_range=_time(way),
        y_range=_span(angles),
        height=330,
    )
    return Picture(f"joints{suffix}", "Joint angles as driven", _there(way), (panel,))


def bar(cell: Cell, way: Driven, drive: Drive, suffix: str) -> Picture:
    """Length of the bar, and its tilt in both ball joints, against what they allow."""
    g, t = cell.gauge, way.motion.t
    low, high = float(to_mm(g.length_min)), float(to_mm(g.length_max))
    pad = 0.12 * (high - low)
    length = Panel(
        "Length of the bar",
        SECONDS,
        "bar length (mm)",
        (Series("", t, to_mm(way.length), "#555555"), *_visits(way, drive)),
        limits=(Limit(low, f"shortest, {low:g} mm", below=True), Limit(high, f"longest, {high:g} mm")),
        x_range=_time(way),
        y_range=(low - pad, high + pad),
    )
    cones = sorted({float(to_deg(c)) for c in (g.cone_fixture, g.cone_map)})
    tilt = Panel(
        "Tilt of the bar in its ball joints",
        SECONDS,
        "tilt (deg)",
        tuple(
            Series(f"at the {place}", t, to_deg(angle), colour)
            for place, angle, colour in zip(("fixture", "tool"), way.tilt.T, (BLUE, ORANGE), strict=True)
        ),
        limits=tuple(Limit(c, f"largest tilt, {c:g} deg") for c in cones),
        x_range=_time(way),
        y_range=(0.0, cones[-1] * 1.15),
    )
    return Picture(
        f"bar{suffix}", "The bar along the way", f"Points are measuring poses. {_there(way)}", (length, tilt)
    )


def contact(cell: Cell, drive: Drive, suffix: str) -> Picture | None:
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
        limits=(Limit(usable, f"indicators make contact within {usable:g} mm"),),
        y_range=(0.0, 1.25 * usable),
    )
    return Picture(
        f"contact{suffix}",
        "First contact of the uncalibrated robot",
        "95 % of robots as uncertain as this one meet the ball nearer to the centre than the point shows.",
        (panel,),
    )


def speeds(cell: Cell, way: Driven, drive: Drive, suffix: str) -> Picture:
    """Speed of the tool point and of the joints against their limits, and the largest use of every limit."""
    t, limit = way.motion.t, float(to_mm(cell.motion.tool_speed))
    speed = to_mm(way.motion.tool_speed)
    limited = bool(np.isfinite(drive.trajectory.tool_speed_limit).any())
    tool = Panel(
        "Speed of the tool point",
        SECONDS,
        "speed (mm/s)",
        (Series("", t, speed, BLUE),),
        limits=(Limit(limit, f"measuring speed, {limit:.3g} mm/s = {limit * 60:g} mm/min"),) if limited else (),
        x_range=_time(way),
        y_range=(0.0, 1.25 * max(limit if limited else 0.0, float(speed.max()))),
    )
    share = 100 * way.share
    axes = Panel(
        "Speed of the joints",
        SECONDS,
        "part of its limit (%)",
        tuple(Series(f"joint {j + 1}", t, s, JOINTS[j % len(JOINTS)], width=1.1) for j, s in enumerate(share.T)),
        x_range=_time(way),
        y_range=(0.0, max(1.0, 1.15 * float(share.max()))),
    )
    return Picture(f"speeds{suffix}", "Speeds against their limits", _there(way), (tool, axes, _use(drive)))


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
        limits=(Limit(100.0, "limit", upright=True),),
        x_range=(0.0, 112.0),
        y_names=tuple(names),
        height=26 * len(names) + 20,
    )


def _joints(t: Array, q: Array) -> tuple[Series, ...]:
    return tuple(Series(f"joint {j + 1}", t, a, JOINTS[j % len(JOINTS)]) for j, a in enumerate(to_deg(q).T))


def _visits(way: Driven, drive: Drive) -> list[Series]:
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


def _time(way: Driven) -> tuple[float, float]:
    """Room for a point at either end."""
    return -0.008 * way.ends, 1.008 * way.ends


def _span(angles: Array) -> tuple[float, float]:
    pad = 0.06 * float(np.ptp(angles)) + 1.0
    return float(angles.min()) - pad, float(angles.max()) + pad


def _there(way: Driven) -> str:
    text = f"From the mount pose through all poses to the mount pose again, {seconds(way.ends)}"
    return f"{text}; then the same way is driven back." if way.returns else f"{text}."
