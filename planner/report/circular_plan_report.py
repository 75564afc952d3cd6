"""The report of a planned circular test, and its charts."""

from pathlib import Path

import numpy as np
from plotly.offline import get_plotlyjs

from planner.cell.cell import Cell
from planner.common.files import write_bytes, write_text
from planner.common.units import UM, to_deg, to_mm
from planner.instruments.circular.plan import Arc, CircularDrive, CircularPlan
from planner.kinematics.bar_geometry import bar_state
from planner.report.cell_view import VIEW_FRAMES, CellView, ViewFrames, ViewPose, carrier_poses, compose_cell_view
from planner.report.cell_view_rendering import player_json, view_json, view_png
from planner.report.chart import JOINTS, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import duration_text
from planner.report.matplotlib_backend import chart_png
from planner.report.page import FOLDER, load_template, safe_json
from planner.report.plotly_backend import chart_json

ANGLE = "angle on the circle (deg)"


def arc_chart(cell: Cell, arc: Arc, number: int) -> Chart:
    """Joint angles and speeds over the circle's angle; the sweep that is measured lies between the dotted lines."""
    c, angle = arc.circle, to_deg(arc.angle)
    span = (float(angle[0]), float(angle[-1]))
    ends = (
        ReferenceLine(float(to_deg(c.start)), "sweep", upright=True),
        ReferenceLine(float(to_deg(c.start + c.sweep)), "", upright=True),
    )
    motion = arc.trajectory.at(arc.trajectory.waypoint_time)
    axes = tuple(
        Series(f"joint {j + 1}", angle, to_deg(q), JOINTS[j % len(JOINTS)], width=1.2) for j, q in enumerate(arc.q.T)
    )
    speeds = tuple(
        Series(f"joint {j + 1}", angle, to_deg(v), JOINTS[j % len(JOINTS)], width=1.2)
        for j, v in enumerate(motion.dq.T)
    )
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


Row = tuple[str, ...]


def write_plan_report(plan: CircularPlan, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same plan gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    stage = circular_view(plan)
    drawn = [arc_chart(plan.cell, a, k) for k, a in enumerate(_arcs(plan))]
    page = load_template("circular/plan.html.j2").render(
        title=f"Circular test for {plan.cell.robot.title}",
        plan=plan,
        facts=_facts(plan),
        circles=tuple(_circle(plan, a) for a in _arcs(plan)),
        passes=tuple(_pass(d, k) for d in plan.drives for k in range(len(d.passes))),
        verdicts=_verdicts(plan),
        pictures=drawn,
        figures=[(p.name, safe_json(chart_json(p))) for p in drawn],
        view=safe_json(view_json(stage)),
        player_data=safe_json(player_json(stage)),
        player=(FOLDER / "player.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    (folder / "pictures").mkdir(exist_ok=True)
    prints = [("view", view_png(stage)), *((p.name, chart_png(p)) for p in drawn)]
    paths = [folder / "pictures" / f"{name}.png" for name, _ in prints]
    for path, (_, data) in zip(paths, prints, strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def circular_view(plan: CircularPlan) -> CellView:
    """The view in space: robot and bar on every circle in the sense in which angles grow."""
    cell, arcs = plan.cell, _arcs(plan)
    poses, labels = [], []
    for arc in arcs:
        rows = np.linspace(0, len(arc.q) - 1, VIEW_FRAMES // len(arcs)).astype(int)
        poses.append(carrier_poses(cell, arc.circle.fixture, arc.q[rows]))
        labels += [
            f"circle {arc.circle.name}   {to_deg(arc.angle[k]):.0f} deg   bar {to_mm(arc.length[k]):.1f} mm   "
            f"axes {'  '.join(f'{a:.1f}' for a in to_deg(arc.q[k]))} deg"
            for k in rows
        ]
    spots = []
    for drive in plan.drives:
        x = cell.map_position(np.asarray(cell.fixtures[drive.fixture].mount)[None])
        length = bar_state(x, cell.fixtures[drive.fixture].p_BX).length[0]
        spots.append(ViewPose(to_mm(x[0]), "mount", f"the bar is attached: {to_mm(length):.1f} mm"))
    return compose_cell_view(
        cell,
        ViewFrames(np.vstack(poses), tuple(labels)),
        cloud=np.empty((0, 3)),
        paths=tuple(to_mm(cell.map_position(a.q)) for a in arcs),
        ways=tuple(to_mm(cell.map_position(d.travel.trajectory.sample(0.05).q)) for d in plan.drives),
        spots=tuple(spots),
    )


def _arcs(plan: CircularPlan) -> list[Arc]:
    return [a for d in plan.drives for a in d.arcs]


def _facts(plan: CircularPlan) -> tuple[Row, ...]:
    arcs = _arcs(plan)
    measured = sum(p.arc is not None for d in plan.drives for p in d.passes)
    verdicts = [v for _, part in _judged(plan) for v in part]
    engines = ", ".join(dict.fromkeys(v.engine for v in verdicts))
    return (
        ("circles", str(len(arcs)), ", ".join(a.circle.name for a in arcs)),
        ("passes", str(measured), "measured, with run-up and overshoot"),
        ("driving", duration_text(sum(d.duration for d in plan.drives)), "with the bar on"),
        ("clearance", f"{to_mm(min(v.clearance for v in verdicts)):.1f} mm", f"found by {engines}"),
    )


def _circle(plan: CircularPlan, arc: Arc) -> Row:
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


def _pass(drive: CircularDrive, k: int) -> Row:
    one = drive.passes[k]
    way = "back to where the bar is taken off" if k + 1 == len(drive.passes) else "to the next circle"
    what = way if one.arc is None else f"circle {drive.arcs[one.arc].circle.name}, {one.direction}"
    load = "" if one.load is None else f"{one.load:g} N"
    marks = ", ".join(map(str, one.marks)) or "–"
    return (
        what,
        load,
        str(one.repeat + 1) if one.arc is not None else "",
        marks,
        duration_text(one.trajectory.duration_s),
    )


def _judged(plan: CircularPlan) -> list[tuple[str, tuple]]:  # type: ignore[type-arg]
    out = [(f"circle {a.circle.name}", a.verdicts) for a in _arcs(plan)]
    return out + [("the ways there and between", d.verdicts) for d in plan.drives]


def _verdicts(plan: CircularPlan) -> tuple[Row, ...]:
    return tuple(
        (
            f"{what}, judged by {v.engine}",
            f"{'free, proven between the checked states too' if v.clear else 'not proven free'}; nearest pair "
            f"{to_mm(v.clearance):.1f} mm apart ({to_mm(plan.cell.motion.clearance):g} mm asked for)",
        )
        for what, part in _judged(plan)
        for v in part
    )
