"""The report of a measured circular test: polar plots, the figures of ISO 230-4, steps at reversals."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure
from plotly.offline import get_plotlyjs

from planner.common.files import write_bytes, write_text
from planner.common.units import UM, Array, to_deg, to_mm
from planner.instruments.circular.evaluation import CircularTest
from planner.instruments.circular.figures import CircleFigures, PathFigures
from planner.report.chart import BLUE, GREY, RED, Chart, Panel, ReferenceLine, Series
from planner.report.matplotlib_backend import chart_png, figure_png, print_style
from planner.report.page import load_template, safe_json
from planner.report.plotly_backend import FONT, INK, chart_json

POINTS = 1440  # of a path at most: a picture has no more
COLOURS = {"ccw": BLUE, "cw": RED}
ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)
INNER = 3.0  # the least-squares circle is drawn so many times the largest deviation from the middle


@dataclass(frozen=True)
class PolarPath:
    """A path for the plot: direction, angles (m,) [deg] and radial deviations (m,) [µm], in order of the angle."""

    direction: str
    angle: Array
    radial: Array


def polar_paths(circle: CircleFigures) -> tuple[PolarPath, ...]:
    """Thin the paths of a circle to what a picture shows; deviations are from the least-squares circle of all."""
    out = []
    for path in circle.paths:
        order = np.argsort(path.angle, kind="stable")
        parts = np.array_split(order, min(POINTS, len(order)))
        angle = np.array([path.angle[p].mean() for p in parts])
        radial = np.array([path.radial[p].mean() for p in parts]) - circle.D
        out.append(PolarPath(path.direction, to_deg(angle), radial / UM))
    return tuple(out)


def division(circle: CircleFigures) -> float:
    """Micrometres from one ring of the plot to the next: a round number, three of them hold all deviations."""
    largest = max(max(p.F_max - circle.D, circle.D - p.F_min) for p in circle.paths) / UM
    rough = max(largest / 3.0, 1e-3)
    ten = 10.0 ** np.floor(np.log10(rough))
    return float(ten * next(r for r in ROUND if r * ten >= rough))


def magnification(circle: CircleFigures) -> float:
    """How many times larger than the circle's radius the deviations are drawn."""
    return circle.ring.radius / (INNER * 3.0 * division(circle) * UM)


def polar_png(circle: CircleFigures) -> bytes:
    """Return the plot for print."""
    step = division(circle)
    rings = step * np.arange(-3, 4)
    with print_style():
        figure = Figure(figsize=(6.4, 6.4))
        ax = figure.add_axes((0.08, 0.06, 0.84, 0.84), projection="polar")
        for path in polar_paths(circle):
            ax.plot(
                np.deg2rad(path.angle), path.radial, color=COLOURS[path.direction], linewidth=1.1, label=path.direction
            )
        around = np.linspace(0, 2 * np.pi, 361)
        ax.plot(around, np.zeros_like(around), color=GREY, linewidth=0.8, linestyle="--", label="least-squares circle")
        ax.set_rorigin(-3.0 * INNER * step)  # type: ignore[attr-defined]
        ax.set_rlim(-3.4 * step, 3.4 * step)  # type: ignore[attr-defined]
        labels = [f"{r:+g}" if r else "0" for r in rings]
        ax.set_rgrids(rings, labels, angle=22.5, fontsize=8)  # type: ignore[attr-defined]
        ax.set_title(f"Circle {_title(circle)}: {step:g} µm a division")
        ax.legend(loc="center", fontsize=9)
        return figure_png(figure)


def polar_json(circle: CircleFigures) -> str:
    """Return the plot for the page, a plotly figure as JSON."""
    step = division(circle)
    around = np.linspace(0.0, 360.0, 361)
    fig = go.Figure()
    for path in polar_paths(circle):
        text = [f"{a:.1f}°: {r:+.1f} µm {path.direction}" for a, r in zip(path.angle, path.radial, strict=True)]
        line = {"color": COLOURS[path.direction], "width": 1.5}
        fig.add_trace(
            go.Scatterpolar(
                theta=path.angle,
                r=path.radial,
                mode="lines",
                name=path.direction,
                line=line,
                hovertext=text,
                hoverinfo="text",
            )
        )
    dashed = {"color": GREY, "width": 1, "dash": "dash"}
    fig.add_trace(
        go.Scatterpolar(
            theta=around, r=0 * around, mode="lines", name="least-squares circle", line=dashed, hoverinfo="skip"
        )
    )
    rings = (step * np.array([-2, 0, 2])).tolist()
    fig.update_layout(
        template=None,
        height=620,
        margin={"l": 40, "r": 40, "t": 30, "b": 30},
        font={"family": FONT, "size": 14, "color": INK},
        paper_bgcolor="white",
        polar={
            "bgcolor": "white",
            "angularaxis": {"gridcolor": "#EEEEEE", "linecolor": "#CCCCCC", "ticksuffix": "°"},
            "radialaxis": {
                "range": [-3.0 * INNER * step, 3.4 * step],
                "tickvals": rings,
                "ticktext": [f"{r:+g} µm" if r else "0" for r in rings],
                "gridcolor": "#E4E4E4",
                "angle": 22.5,
                "tickangle": 0,
                "tickfont": {"size": 11},
            },
        },
    )
    return str(fig.to_json())


def _title(circle: CircleFigures) -> str:
    return circle.ring.name if circle.load is None else f"{circle.ring.name} at {circle.load:g} N"


Row = tuple[str, ...]


def write_test_report(test: CircularTest, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same test gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    charts = [_chart(c, k) for k, c in enumerate(test.circles)]
    names = [f"polar_{k + 1}" for k in range(len(test.circles))]
    figures = [(n, safe_json(polar_json(c))) for n, c in zip(names, test.circles, strict=True)]
    figures += [(p.name, safe_json(chart_json(p))) for p in charts]
    page = load_template("circular/measured.html.j2").render(
        test=test,
        facts=[_facts(c) for c in test.circles],
        circles=[_circle(c, n, chart) for c, n, chart in zip(test.circles, names, charts, strict=True)],
        figures=figures,
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    (folder / "pictures").mkdir(exist_ok=True)
    prints = [(n, polar_png(c)) for n, c in zip(names, test.circles, strict=True)]
    prints += [(p.name, chart_png(p)) for p in charts]
    paths = [folder / "pictures" / f"{name}.png" for name, _ in prints]
    for path, (_, data) in zip(paths, prints, strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def _facts(c: CircleFigures) -> Row:
    """What a person asks for first."""
    if c.G_b is not None:
        return (_name(c), f"{micrometres(c.G_b)} µm", "G(b), both directions between two circles")
    path = c.paths[0]
    return (_name(c), f"{micrometres(path.G)} µm", f"G({path.direction}), between two circles")


def _circle(c: CircleFigures, polar: str, chart: Chart) -> dict[str, object]:
    return {
        "name": _name(c),
        "plane": c.ring.plane,
        "polar": polar,
        "chart": chart,
        "division": f"{division(c):g}",
        "magnification": f"{magnification(c):.0f}",
        "figures": tuple(_figures(p) for p in c.paths),
        "together": _together(c),
        "reversals": tuple(row for p in c.paths for row in _reversals(p)),
    }


def _figures(p: PathFigures) -> Row:
    values = (p.G, p.G_ls, p.F_max, p.F_min, p.mean, *p.offset)
    return (p.direction, *(micrometres(v) for v in values), str(p.sweeps))


def _together(c: CircleFigures) -> tuple[Row, ...]:
    first, second = c.ring.plane[0], c.ring.plane[1]
    rows = [
        (
            "centre, by least squares, taken off",
            (
                f"{first} {micrometres(c.centre.centre[0])} ± {micrometres(c.centre.std[0])} µm, {second}"
                f" {micrometres(c.centre.centre[1])} ± {micrometres(c.centre.std[1])} µm from the planned one"
            ),
        ),
        ("mean radial deviation D", f"{micrometres(c.D)} µm"),
    ]
    if c.G_b is not None:
        rows += [
            (
                "bidirectional circular deviation G(b)",
                f"{micrometres(c.G_b)} µm; about the least-squares centre {micrometres(c.G_b_ls)} µm",
            ),
            ("hysteresis H, ccw less cw", f"{micrometres(c.H)} µm at most, {micrometres(c.H_mean)} µm on average"),
        ]
    return (
        *rows,
        ("range of the bar that is used", f"{to_mm(c.length_range):.4f} mm"),
        ("range of readings less the length at the joint angles read", f"{to_mm(c.calculated_range):.4f} mm"),
    )


def _reversals(p: PathFigures) -> list[Row]:
    return [
        (
            p.direction,
            f"{to_deg(r.angle):.1f}",
            ", ".join(str(j + 1) for j in r.joints),
            "–" if math.isnan(r.step) else f"{micrometres(r.step)} ± {micrometres(r.std)}",
        )
        for r in p.reversals
    ]


def _chart(c: CircleFigures, number: int) -> Chart:
    paths = polar_paths(c)
    series = tuple(Series(p.direction, p.angle, p.radial, COLOURS[p.direction], width=1.2) for p in paths)
    marks = {round(float(to_deg(r.angle)), 1): r.joints for p in c.paths[:1] for r in p.reversals}
    limits = tuple(
        ReferenceLine(a, "axis " + ", ".join(str(j + 1) for j in js), upright=True) for a, js in marks.items()
    )
    start, end = float(to_deg(c.ring.start)), float(to_deg(c.ring.start + c.ring.sweep))
    panel = Panel(
        "",
        "angle on the circle (deg)",
        "radial deviation (µm)",
        series,
        limits=limits,
        x_range=(start, end),
        height=300,
    )
    return Chart(
        f"radial_{number + 1}",
        f"Circle {_name(c)}: radial deviation over the angle",
        "From the least-squares circle of both directions. Dotted: where an axis of the robot reverses.",
        (panel,),
    )


def _name(c: CircleFigures) -> str:
    return c.ring.name if c.load is None else f"{c.ring.name}, {c.load:g} N"


def micrometres(value: float | None) -> str:
    """Write a length [m] in micrometres."""
    return "–" if value is None else f"{float(value) / UM:.1f}"
