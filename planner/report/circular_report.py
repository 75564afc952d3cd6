"""Reports of a circular test: the plan, then as measured by polar plots, figures of ISO 230-4, steps at reversals."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from planner.circular.evaluation import CircularTest
from planner.circular.figures import CircleFigures, PathFigures
from planner.circular.plan import Arc, CircularDrive, CircularPass, CircularPlan
from planner.common.units import UM, to_deg, to_mm
from planner.report.cell_view import VIEW_FRAMES, CellView, ShownMotion, ViewPose, tool_points, view_session
from planner.report.chart import BLUE, GREY, POLAR_BASE, RED, Chart, Panel, ReferenceLine, Series, joint_series
from planner.report.formatting import clearance_fact, duration_text, in_um, verdict_rows
from planner.report.page import Report, Row

ANGLE = "angle on the circle (deg)"
COLOURS = {"ccw": BLUE, "cw": RED}


def report_circular_test(test: CircularTest) -> Report:
    """Return the page of a measured circular test and its pictures."""
    polar = [polar_chart(c, k) for k, c in enumerate(test.circles)]
    radial = [radial_chart(c, k) for k, c in enumerate(test.circles)]
    content = {
        "test": test,
        "facts": [_facts(c) for c in test.circles],
        "circles": [
            {
                "name": _name(c),
                "plane": c.ring.circle.plane,
                "polar": polar[k],
                "chart": radial[k],
                "figures": [_figures(p) for p in c.paths],
                "together": _common_rows(c),
                "reversals": [row for p in c.paths for row in _reversals(p)],
            }
            for k, c in enumerate(test.circles)
        ],
    }
    return Report("circular.html.j2", content, (*polar, *radial))


def division(circle: CircleFigures) -> float:
    """Micrometres from one ring of the plot to the next: a round number, three of them hold all deviations."""
    largest = max(max(p.F_max - circle.D, circle.D - p.F_min) for p in circle.paths) / UM
    rough = max(largest / 3.0, 1e-3)
    ten = 10.0 ** np.floor(np.log10(rough))
    return float(ten * next(r for r in (1.0, 2.0, 2.5, 5.0, 10.0) if r * ten >= rough))  # round numbers


def path_series(circle: CircleFigures) -> tuple[Series, ...]:
    """Radial deviation [µm] from the least-squares circle of all paths over the angle [deg], thinned to a picture."""
    out = []
    for path in circle.paths:
        order = np.argsort(path.angle, kind="stable")
        parts = np.array_split(order, min(1440, len(order)))  # of a path at most: a picture has no more
        angle = to_deg(np.array([path.angle[p].mean() for p in parts]))
        radial = (np.array([path.radial[p].mean() for p in parts]) - circle.D) / UM
        hover = tuple(f"{a:.1f}°: {r:+.1f} µm {path.direction}" for a, r in zip(angle, radial, strict=True))
        out.append(Series(path.direction, angle, radial, COLOURS[path.direction], width=1.4, hover=hover))
    return tuple(out)


def polar_chart(c: CircleFigures, number: int) -> Chart:
    """The plot that ball-bar users know: the path about its circle, with the deviations magnified."""
    ring, around = division(c), np.linspace(0.0, 360.0, 361)
    circle = Series("least-squares circle", around, 0 * around, GREY, dashed=True, width=1.0)
    times = c.ring.circle.radius / (POLAR_BASE * ring * UM)
    title = f"Circle {_name(c)}"
    panel = Panel(f"{title}: {ring:g} µm a division", "", "µm", (*path_series(c), circle), height=620, rings=ring)
    caption = (
        f"Deviations drawn {times:.0f} times larger than the circle, {ring:g} µm a division; from the least-squares "
        "circle of both directions; outwards is a longer bar."
    )
    return Chart(f"polar_{number + 1}", title, caption, (panel,))


def radial_chart(c: CircleFigures, number: int) -> Chart:
    """Radial deviation over the angle, with the reversals of the axes."""
    reversals = {round(float(to_deg(r.angle)), 1): r.joints for p in c.paths[:1] for r in p.reversals}
    lines = [ReferenceLine(angle, f"axis {_axes(joints)}", upright=True) for angle, joints in reversals.items()]
    span = (float(to_deg(c.ring.circle.start)), float(to_deg(c.ring.circle.start + c.ring.circle.sweep)))
    panel = Panel("", ANGLE, "radial deviation (µm)", path_series(c), tuple(lines), x_range=span, height=300)
    title = f"Circle {_name(c)}: radial deviation over the angle"
    caption = "From the least-squares circle of both directions. Dotted: where an axis of the robot reverses."
    return Chart(f"radial_{number + 1}", title, caption, (panel,))


def _facts(c: CircleFigures) -> Row:
    """What a person asks for first."""
    if c.G_b is not None:
        return (f"circle {_name(c)}", f"{in_um(c.G_b)} µm", "G(b), both directions between two circles")
    path = c.paths[0]
    return (f"circle {_name(c)}", f"{in_um(path.G)} µm", f"G({path.direction}), between two circles")


def _figures(p: PathFigures) -> Row:
    values = (p.G, p.G_ls, p.F_max, p.F_min, p.mean, *p.offset)
    return (p.direction, *(in_um(v) for v in values), str(p.sweeps))


def _common_rows(c: CircleFigures) -> tuple[Row, ...]:
    each = zip(c.ring.circle.plane, c.centre.centre, c.centre.std, strict=True)
    centre = ", ".join(f"{axis} {in_um(value)} ± {in_um(std)} µm" for axis, value, std in each)
    both = f"{in_um(c.G_b)} µm; about the least-squares centre {in_um(c.G_b_ls)} µm"
    of_both_directions = (
        ("bidirectional circular deviation G(b)", both),
        ("hysteresis H, ccw less cw", f"{in_um(c.H)} µm at most, {in_um(c.H_mean)} µm on average"),
    )
    return (
        ("centre, by least squares, taken off", f"{centre} from the planned one"),
        ("mean radial deviation D", f"{in_um(c.D)} µm"),
        *(of_both_directions if c.G_b is not None else ()),
        ("range of the bar that is used", f"{to_mm(c.length_range):.4f} mm"),
        ("range of readings less the length at the joint angles read", f"{to_mm(c.calculated_range):.4f} mm"),
    )


def _reversals(p: PathFigures) -> Iterator[Row]:
    for r in p.reversals:
        jump = "–" if math.isnan(r.step) else f"{in_um(r.step)} ± {in_um(r.std)}"
        yield (p.direction, f"{to_deg(r.angle):.1f}", _axes(r.joints), jump)


def _axes(joints: Sequence[int]) -> str:
    return ", ".join(str(j + 1) for j in joints)


def _name(c: CircleFigures) -> str:
    return c.ring.circle.name if c.load is None else f"{c.ring.circle.name}, {c.load:g} N"


def arc_chart(arc: Arc, number: int) -> Chart:
    """Joint angles and speeds over the circle's angle; the sweep that is measured lies between the dotted lines."""
    c, angle = arc.circle, to_deg(arc.angle)
    ends = tuple(
        ReferenceLine(float(to_deg(end)), text, upright=True)
        for end, text in ((c.start, "sweep"), (c.start + c.sweep, ""))
    )
    motion = arc.ccw.trajectory.at(arc.ccw.trajectory.waypoint_time)
    axes = joint_series(angle, to_deg(arc.q), width=1.2)
    speeds = joint_series(angle, to_deg(motion.dq), width=1.2)
    tool = (Series("", angle, to_mm(motion.tool_speed), "#555555"),)
    panels = tuple(
        Panel(title, ANGLE, label, series, ends, x_range=(float(angle[0]), float(angle[-1])), height=height)
        for title, label, series, height in (
            ("Joint angles", "joint angle (deg)", axes, 280),
            ("Speed of the joints, ccw", "speed (deg/s)", speeds, 240),
            ("Speed of the tool point, ccw", "speed (mm/s)", tool, 160),
        )
    )
    caption = "Where the speed of a joint crosses zero it reverses: there backlash and friction show."
    return Chart(f"circle_{number + 1}", f"Circle {c.name}: the axes along it", caption, panels)


def report_circular_plan(plan: CircularPlan) -> Report:
    """Return the page of a planned circular test and its pictures."""
    arcs = plan.arcs
    judged = [(f"circle {a.circle.name}", a.verdicts) for a in arcs]
    judged += [("the paths there and between", d.verdicts) for d in plan.drives]
    content = {
        "plan": plan,
        "facts": _plan_facts(plan),
        "circles": [_circle(a) for a in arcs],
        "passes": [_pass(d, p) for d in plan.drives for p in d.passes],
        "verdicts": [row for what, verdicts in judged for row in verdict_rows(what, verdicts, plan.cell)],
    }
    charts = tuple(arc_chart(a, k) for k, a in enumerate(arcs))
    return Report("circular_plan.html.j2", content, charts, circular_view(plan))


def circular_view(plan: CircularPlan) -> CellView:
    """The view in space: robot and bar on every circle in the sense in which angles grow."""
    cell, arcs = plan.cell, plan.arcs
    shown = [_show_arc(a, VIEW_FRAMES // len(arcs)) for a in arcs]
    spots = []
    for drive in plan.drives:
        q = np.asarray(cell.mount(drive.mounting))[None]
        length = cell.bar_length(q, drive.mounting)[0]
        text = f"the bar is attached: {to_mm(length):.1f} mm"
        spots.append(ViewPose(tool_points(cell, drive.mounting, q)[0], "mount", text))
    return view_session(cell, plan.courses, shown, spots)


def _show_arc(arc: Arc, count: int) -> ShownMotion:
    rows = np.linspace(0, len(arc.q) - 1, count).astype(int)
    told = [
        f"circle {arc.circle.name}   {to_deg(arc.angle[k]):.0f} deg   bar {to_mm(arc.length[k]):.1f} mm" for k in rows
    ]
    return ShownMotion(arc.circle.mounting, arc.q[rows], told, arc.q)


def _plan_facts(plan: CircularPlan) -> tuple[Row, ...]:
    arcs = plan.arcs
    measured = sum(p.arc is not None for d in plan.drives for p in d.passes)
    return (
        ("circles", str(len(arcs)), ", ".join(a.circle.name for a in arcs)),
        ("passes", str(measured), "measured, with run-up and overshoot"),
        ("driving", duration_text(sum(c.duration for c in plan.courses)), "with the bar on"),
        clearance_fact(plan.verdicts, plan.cell),
    )


def _circle(arc: Arc) -> Row:
    c = arc.circle
    centre = ", ".join(f"{v:g}" for v in np.round(to_mm(c.p_BC), 3))
    return (
        c.name,
        c.plane,
        f"[{centre}]",
        f"{to_mm(c.radius):g}",
        f"{arc.off / UM:.1f}",
        f"{to_deg(c.start):g}° + {to_deg(c.sweep):g}°, overshoot {to_deg(c.overshoot):g}°",
        " and ".join(c.directions),
        ", ".join(f"{load:g}" for load in c.loads) or "–",
        f"{to_mm(c.speed):.4g} (slowest {to_mm(arc.slowest_on_sweep):.4g})",
        f"{to_mm(arc.length.min()):.2f} – {to_mm(arc.length.max()):.2f}",
        arc.told,
    )


def _pass(drive: CircularDrive, one: CircularPass) -> Row:
    what = one.heading if one.arc is None else f"circle {drive.arcs[one.arc].circle.name}, {one.direction}"
    load = "" if one.load is None else f"{one.load:g} N"
    marks = ", ".join(map(str, one.marks)) or "–"
    repeat = "" if one.arc is None else str(one.repeat + 1)
    return (what, load, repeat, marks, duration_text(one.trajectory.duration_s))
