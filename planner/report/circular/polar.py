"""The plot that ball-bar users know: the path about its circle, with the deviations magnified."""

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure

from planner.circular.figures import CircleFigures
from planner.report.picture import BLUE, GREY, RED
from planner.report.printed import png, style
from planner.report.web import FONT, INK
from planner.units import UM, Array, to_deg

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
    with style():
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
        ax.set_rgrids(rings, [f"{r:+g}" if r else "0" for r in rings], angle=22.5, fontsize=8)  # type: ignore[attr-defined]
        ax.set_title(f"Circle {_title(circle)}: {step:g} µm a division")
        ax.legend(loc="center", fontsize=9)
        return png(figure)


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
