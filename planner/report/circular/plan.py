"""The page of a planned circular test, and its pictures for print."""

from pathlib import Path

import numpy as np
from plotly.offline import get_plotlyjs

from planner.circular import Arc, CircularDrive, CircularPlan
from planner.files import write_bytes, write_text
from planner.gauge import bar_state
from planner.report.circular.drawing import arc_picture
from planner.report.printed import picture_png
from planner.report.stage import FRAMES, Frames, Spot, Stage, carrier_poses, staged
from planner.report.stage_print import view_png
from planner.report.stage_web import player_json, view_json
from planner.report.template import HERE, embedded, template
from planner.report.web import figure_json
from planner.report.words import seconds
from planner.units import UM, to_deg, to_mm

Row = tuple[str, ...]


def write_plan_report(plan: CircularPlan, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same plan gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    stage = circular_stage(plan)
    drawn = [arc_picture(plan.cell, a, k) for k, a in enumerate(_arcs(plan))]
    page = template("circular/plan.html.j2").render(
        title=f"Circular test for {plan.cell.robot.title}",
        plan=plan,
        facts=_facts(plan),
        circles=tuple(_circle(plan, a) for a in _arcs(plan)),
        passes=tuple(_pass(d, k) for d in plan.drives for k in range(len(d.passes))),
        verdicts=_verdicts(plan),
        pictures=drawn,
        figures=[(p.name, embedded(figure_json(p))) for p in drawn],
        view=embedded(view_json(stage)),
        player_data=embedded(player_json(stage)),
        player=(HERE / "player.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    (folder / "pictures").mkdir(exist_ok=True)
    prints = [("view", view_png(stage)), *((p.name, picture_png(p)) for p in drawn)]
    paths = [folder / "pictures" / f"{name}.png" for name, _ in prints]
    for path, (_, data) in zip(paths, prints, strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def circular_stage(plan: CircularPlan) -> Stage:
    """The view in space: robot and bar on every circle in the sense in which angles grow."""
    cell, arcs = plan.cell, _arcs(plan)
    poses, labels = [], []
    for arc in arcs:
        rows = np.linspace(0, len(arc.q) - 1, FRAMES // len(arcs)).astype(int)
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
        spots.append(Spot(to_mm(x[0]), "mount", f"the bar is attached: {to_mm(length):.1f} mm"))
    return staged(
        cell,
        Frames(np.vstack(poses), tuple(labels)),
        cloud=np.empty((0, 3)),
        paths=tuple(to_mm(cell.map_position(a.q)) for a in arcs),
        ways=tuple(to_mm(cell.map_position(d.way_trajectory.sample(0.05).q)) for d in plan.drives),
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
        ("driving", seconds(sum(d.duration for d in plan.drives)), "with the bar on"),
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
    return (what, load, str(one.repeat + 1) if one.arc is not None else "", marks, seconds(one.trajectory.duration_s))


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
