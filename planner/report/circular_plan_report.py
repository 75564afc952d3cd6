"""The report of a planned circular test, and its charts."""

import numpy as np

from planner.common.units import UM, to_deg, to_mm
from planner.instruments.circular.plan import Arc, CircularDrive, CircularPass, CircularPlan
from planner.kinematics.bar_geometry import bar_state
from planner.report.cell_view import VIEW_FRAMES, CellView, ViewFrames, ViewPose, carrier_poses, compose_cell_view
from planner.report.chart import Chart, Panel, ReferenceLine, Series, joint_series
from planner.report.formatting import clearance_fact, duration_text, verdict_rows
from planner.report.page import Report, Row

ANGLE = "angle on the circle (deg)"


def arc_chart(arc: Arc, number: int) -> Chart:
    """Joint angles and speeds over the circle's angle; the sweep that is measured lies between the dotted lines."""
    c, angle = arc.circle, to_deg(arc.angle)
    span = (float(angle[0]), float(angle[-1]))
    ends = (
        ReferenceLine(float(to_deg(c.start)), "sweep", upright=True),
        ReferenceLine(float(to_deg(c.start + c.sweep)), "", upright=True),
    )
    motion = arc.ccw.trajectory.at(arc.ccw.trajectory.waypoint_time)
    axes = joint_series(angle, to_deg(arc.q), width=1.2)
    speeds = joint_series(angle, to_deg(motion.dq), width=1.2)
    tool = (Series("", angle, to_mm(motion.tool_speed), "#555555"),)
    return Chart(
        f"circle_{number + 1}",
        f"Circle {c.name}: the axes along it",
        "Where the speed of a joint crosses zero it reverses: there backlash and friction show.",
        (
            Panel("Joint angles", ANGLE, "joint angle (deg)", axes, limits=ends, x_range=span, height=280),
            Panel("Speed of the joints, ccw", ANGLE, "speed (deg/s)", speeds, limits=ends, x_range=span, height=240),
            Panel("Speed of the tool point, ccw", ANGLE, "speed (mm/s)", tool, limits=ends, x_range=span, height=160),
        ),
    )


def report_circular_plan(plan: CircularPlan) -> Report:
    """Return the page of a planned circular test and its pictures."""
    arcs = plan.arcs
    judged = [(f"circle {a.circle.name}", a.verdicts) for a in arcs]
    judged += [("the ways there and between", d.verdicts) for d in plan.drives]
    content = {
        "plan": plan,
        "facts": _facts(plan),
        "circles": [_circle(a) for a in arcs],
        "passes": [_pass(d, p) for d in plan.drives for p in d.passes],
        "verdicts": [row for what, verdicts in judged for row in verdict_rows(what, verdicts, plan.cell)],
    }
    return Report(
        "circular_plan.html.j2", content, tuple(arc_chart(a, k) for k, a in enumerate(arcs)), circular_view(plan)
    )


def circular_view(plan: CircularPlan) -> CellView:
    """The view in space: robot and bar on every circle in the sense in which angles grow."""
    cell, arcs = plan.cell, plan.arcs
    poses, labels = [], []
    for arc in arcs:
        rows = np.linspace(0, len(arc.q) - 1, VIEW_FRAMES // len(arcs)).astype(int)
        poses.append(carrier_poses(cell, arc.circle.mounting, arc.q[rows]))
        labels += [
            f"circle {arc.circle.name}   {to_deg(arc.angle[k]):.0f} deg   bar {to_mm(arc.length[k]):.1f} mm   "
            f"axes {'  '.join(f'{a:.1f}' for a in to_deg(arc.q[k]))} deg"
            for k in rows
        ]
    spots = []
    for drive in plan.drives:
        x = cell.map_position(np.asarray(cell.mount(drive.mounting))[None])
        length = bar_state(x, cell.fixtures[drive.mounting.fixture].p_BX).length[0]
        spots.append(ViewPose(to_mm(x[0]), "mount", f"the bar is attached: {to_mm(length):.1f} mm"))
    return compose_cell_view(
        cell,
        ViewFrames(np.vstack(poses), tuple(labels)),
        cloud=np.empty((0, 3)),
        paths=tuple(to_mm(cell.map_position(a.q)) for a in arcs),
        ways=tuple(to_mm(cell.map_position(d.course.travel.trajectory.sample(0.05).q)) for d in plan.drives),
        spots=tuple(spots),
    )


def _facts(plan: CircularPlan) -> tuple[Row, ...]:
    arcs = plan.arcs
    measured = sum(p.arc is not None for d in plan.drives for p in d.passes)
    return (
        ("circles", str(len(arcs)), ", ".join(a.circle.name for a in arcs)),
        ("passes", str(measured), "measured, with run-up and overshoot"),
        ("driving", duration_text(sum(c.duration for c in plan.courses)), "with the bar on"),
        clearance_fact(plan.verdicts),
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
