"""The study's picture of other fixture places."""

from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from planner.common.units import MM
from planner.design.fixtures.places import Status
from planner.design.observability.information import INDEX_RULES
from planner.report.matplotlib_backend import figure_png, print_style
from planner.studies.fixture_places import FixtureMap, FixturePlace
from planner.studies.summary import describe_best_place, format_number

STATUS_LOOKS: dict[Status, tuple[str, str, str]] = {
    "blocked": ("no room for fixture or stand", "#9A9A9A", ""),
    "unreachable": ("out of reach", "#F2F2F2", ""),
    "cones": ("ball joints tilt too far", "#F2F2F2", "...."),
    "cable": ("cable twisted too far", "#F2F2F2", "||||"),
    "colliding": ("all poses collide", "#DDDDDD", "xxxx"),
    "few": ("too few poses", "#F2F2F2", "////"),
    "blind": ("sees fewer parameters", "#F2F2F2", "++++"),
}
"""What the legend says of a place that cannot be used, its face and its hatch."""


MARKS: dict[str, dict[str, Any]] = {
    name: {"marker": marker, "markersize": size, "color": "black", "markerfacecolor": "white"}
    for name, marker, size in (("present place", "o", 8), ("best place", "*", 13))
}


def draw_map(places: FixtureMap) -> bytes:
    """Two grids of places, coloured by the index; the present and the best place marked."""
    values = [p.value for p in places.usable]
    norm = LogNorm(min(values), max(max(values), 1.01 * min(values)))
    colours = ScalarMappable(norm, "viridis" if INDEX_RULES[places.index].maximise else "viridis_r")
    with print_style():
        figure = Figure(figsize=(12.5, 6.4), layout="constrained")
        level, upright = figure.subplots(1, 2)
        _draw_level(level, places, colours)
        _draw_upright(upright, places, colours)
        _draw_colour_bar(figure, [level, upright], places, colours)
        figure.legend(handles=_map_legend(places), loc="outside lower center", ncols=5)
        figure.suptitle(fill(describe_best_place(places), 150), x=0.01, ha="left", fontsize=10)
        return figure_png(figure)


def _draw_cells(ax: Axes, places: list[FixturePlace], half: tuple[float, float], colours: ScalarMappable) -> None:
    for p in places:
        box = ((p.along - half[0], p.up - half[1]), 2 * half[0], 2 * half[1])
        if p.status != "usable":
            _, face, hatch = STATUS_LOOKS[p.status]
            ax.add_patch(Rectangle(*box, facecolor=face, hatch=hatch, edgecolor="#BBBBBB", linewidth=0.6))
            continue
        red, green, blue, _ = np.asarray(colours.to_rgba(np.array([p.value])))[0]
        ax.add_patch(Rectangle(*box, facecolor=(red, green, blue), edgecolor="white", linewidth=1.0))
        ink = "white" if 0.3 * red + 0.59 * green + 0.11 * blue < 0.5 else "black"
        ax.annotate(format_number(p.value), (p.along, p.up), ha="center", va="center", fontsize=7.5, color=ink)


def _draw_level(ax: Axes, places: FixtureMap, colours: ScalarMappable) -> None:
    half, far, here = places.half[0], places.reach, places.present.p_BX
    _draw_cells(ax, [p for p in places.places if p.plane == "level"], (half, half), colours)
    ax.add_patch(Circle((0, 0), far, fill=False, edgecolor="#777777", linewidth=0.8, linestyle="--"))
    ax.annotate("axis 1", (0, 0), ha="center", va="center", fontsize=8)
    corner = (0.71 * far, -0.71 * far)
    ax.annotate(f"reach {far:.2f} m", corner, (6, -4), textcoords="offset points", va="top", fontsize=8)
    ax.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    ax.set_title(f"Level, at the fixture's height, {here[2] / MM:.0f} mm")
    edge = far * 1.04 + half
    ax.set(xlim=(-edge, edge), ylim=(-edge, edge))
    _draw_marks(ax, places, "level", (float(here[0]), float(here[1])))


def _draw_upright(ax: Axes, places: FixtureMap, colours: ScalarMappable) -> None:
    mine = [p for p in places.places if p.plane == "upright"]
    along, up = places.half[0] / 2, places.half[1]
    _draw_cells(ax, mine, (along, up), colours)
    ax.set(xlabel="distance from axis 1 (m)", ylabel="height z (m)", aspect="equal")
    ax.set_title("Upright, through axis 1 and the present fixture")
    ups = [p.up for p in mine]
    ax.set(xlim=(0, places.reach * 1.04 + along), ylim=(min(ups) - up - 0.05, max(ups) + up + 0.05))
    _draw_marks(ax, places, "upright", (places.present.along, places.present.up))


def _draw_marks(ax: Axes, places: FixtureMap, plane: str, present: tuple[float, float]) -> None:
    best, half = places.best, places.half[0] if plane == "level" else places.half[1]
    at = {"present place": present}
    if best.plane == plane:
        at["best place"] = (best.along, best.up + 0.6 * half)
    for name, (x, y) in at.items():
        ax.plot([x], [y], **MARKS[name], clip_on=False)


def _draw_colour_bar(figure: Figure, axes: list[Axes], places: FixtureMap, colours: ScalarMappable) -> None:
    low, high = colours.get_clim()
    assert low is not None
    assert high is not None
    better = "higher" if INDEX_RULES[places.index].maximise else "lower"
    bar = figure.colorbar(colours, ax=axes, shrink=0.85, aspect=35)
    bar.set_label(f"{places.index} with {places.poses} poses ({better} is better)")
    inside = [float(f"{v:.2g}") for v in np.geomspace(low, high, 6)[1:-1]]
    ticks = np.unique([low, *inside, high])
    bar.set_ticks(ticks.tolist(), labels=[format_number(v) for v in ticks])
    bar.minorticks_off()


def _map_legend(places: FixtureMap) -> list[Line2D | Patch]:
    marks = [Line2D([], [], label=name, linestyle="", **look) for name, look in MARKS.items()]
    used = {p.status for p in places.places}
    looks = [look for status, look in STATUS_LOOKS.items() if status in used]
    return [*marks, *(Patch(facecolor=f, hatch=h, edgecolor="#777777", label=says) for says, f, h in looks)]
