"""The study's pictures of other fixture places and of further fixtures."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from planner.common.units import MM
from planner.design.observability.information import INDEX_RULES
from planner.report.chart import BLUE, GREY, RED
from planner.report.matplotlib_backend import figure_png, print_style
from planner.study.fixture_count import FixtureCount
from planner.study.fixture_places import FixtureMap, FixturePlace
from planner.study.fixture_reach import Status
from planner.study.summary import CLEAR, format_number, format_place, improvement_percent

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
        figure.suptitle(_map_title(places), x=0.01, ha="left", fontsize=11)
        return figure_png(figure)


def _map_title(places: FixtureMap) -> str:
    best, present, index = places.best, places.present, places.index
    if best is present:
        return f"No place of the grid is better than the present one: {index} {format_number(present.value)}"
    gain = improvement_percent(index, best.value, present.value)
    side = "higher" if INDEX_RULES[index].maximise else "lower"
    if abs(gain) < CLEAR:
        return (
            f"No place of the grid is clearly better than the present one: {index} {format_number(best.value)} at best"
        )
    values = f"{format_number(best.value)} instead of {format_number(present.value)}"
    return f"A fixture at {format_place(best.p_BX)} would make {index} {abs(gain):.0f} % {side}: {values}"


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
    marks = [("o", 8, present)]
    if best.plane == plane:
        marks.append(("*", 13, (best.along, best.up + 0.6 * half)))
    for mark, size, (x, y) in marks:
        ax.plot([x], [y], mark, markersize=size, color="black", markerfacecolor="white", clip_on=False)


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
    marks = [
        Line2D([], [], marker=mark, markersize=size, label=says, color="black", markerfacecolor="white", linestyle="")
        for mark, size, says in (("o", 8, "present place"), ("*", 13, "best place"))
    ]
    used = {p.status for p in places.places}
    patches = [
        Patch(facecolor=face, hatch=hatch, edgecolor="#777777", label=says)
        for status, (says, face, hatch) in STATUS_LOOKS.items()
        if status in used
    ]
    return [*marks, *patches]


PALE = "#A6CEE3"


def draw_fixtures(fixtures: FixtureCount, index: str) -> bytes:
    """What each number of fixtures sees, and which remedy shows each parameter that stays unseen."""
    unseen = [d.name for d in fixtures.steps[0].dropped]
    with print_style():
        figure = Figure(figsize=(11.5, max(3.8, 2.4 + 0.28 * len(unseen))), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.7])
        _draw_steps(left, fixtures, index)
        _draw_matrix(right, fixtures, unseen)
        return figure_png(figure)


def _draw_steps(ax: Axes, fixtures: FixtureCount, index: str) -> None:
    steps = fixtures.steps
    at, robot, seen = ([getattr(s, key) for s in steps] for key in ("fixtures", "robot_seen", "seen"))
    gauge = [s.seen - s.robot_seen for s in steps]
    lost = [s.parameters - s.seen for s in steps]
    ax.bar(at, robot, width=0.6, color=BLUE, label="the robot's own")
    if any(gauge):
        ax.bar(at, gauge, bottom=robot, width=0.6, color=PALE, label="fixtures, tool, zero")
    ax.bar(at, lost, bottom=seen, width=0.6, color="none", edgecolor=GREY, hatch="////", label="not seen")
    for s in steps:
        ax.text(
            s.fixtures, s.parameters + 0.5, f"{index} {format_number(s.value)}", ha="center", va="bottom", fontsize=8.5
        )
        ax.annotate(str(s.robot_seen), (s.fixtures, s.robot_seen / 2), ha="center", va="center", color="white")
    ax.set_xticks(at)
    ax.set_ylim(0, 1.35 * max(s.parameters for s in steps))
    ax.set(xlabel=f"number of fixtures (above the bars: {index} of the robot's own)", ylabel="parameters")
    ax.set_title(_steps_title(fixtures, index))
    ax.legend(loc="upper left", ncols=2, fontsize=8.5)


def _steps_title(fixtures: FixtureCount, index: str) -> str:
    steps = fixtures.steps
    if fixtures.needed > 1:
        return f"{fixtures.needed} fixtures see all that fixtures can show"
    if len(steps) == 1:
        return "One fixture, and no place for another"
    values = f"{index} goes from {format_number(steps[0].value)} to {format_number(steps[1].value)}"
    return f"A second fixture shows no more parameters;\n{values}"


def _draw_matrix(ax: Axes, fixtures: FixtureCount, unseen: list[str]) -> None:
    columns = _matrix_columns(fixtures)
    never = {d.name for d in fixtures.never}
    for y, name in enumerate(unseen):
        for x, (_, shown) in enumerate(columns):
            mark, colour, size = ("o", BLUE, 9) if name in shown else ("x", "#B5B5B5", 5)
            ax.plot(x, y, mark, color=colour, markersize=size)
        if name in never:
            ax.axhspan(y - 0.45, y + 0.45, color=RED, alpha=0.12, linewidth=0)
            ax.text(len(columns) - 0.46, y, "never", va="center", color=RED)
    ax.set_xticks(range(len(columns)), [_wrap_text(head) for head, _ in columns], fontsize=8.5)
    ax.set_yticks(range(len(unseen)), unseen)
    ax.set_xlim(-0.5, max(len(columns), 1) - 0.5)
    ax.set_ylim(max(len(unseen), 1) - 0.5, -0.5)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    hope = len(unseen) - len(never)
    says = f"{hope} of the {len(unseen)} unseen parameters can be shown in some way (dots)"
    ax.set_title(says if unseen else "Nothing stays unseen")


def _matrix_columns(fixtures: FixtureCount) -> list[tuple[str, set[str]]]:
    """Heads, and the parameters that each shows."""
    out, shown = [], set[str]()
    for step in fixtures.steps[1:]:
        shown = shown | set(step.becomes)
        out.append((f"{step.fixtures} fixtures", shown))
    return out + [(r.name, set(r.shows)) for r in fixtures.remedies]


def _wrap_text(text: str) -> str:
    """Break a column's head over short lines."""
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) > 12:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines).strip()
