"""The study's pictures of other fixture places and of more fixtures."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from planner.observability import RULES
from planner.report.picture import BLUE, GREY, RED
from planner.report.printed import png, style
from planner.study.fixture_map import FixtureMap, Plane
from planner.study.fixtures import Fixtures
from planner.study.places import SAYS, Status
from planner.study.summary import improvement, number, place_in_words
from planner.units import MM

HATCH: dict[Status, tuple[str, str]] = {
    "blocked": ("#9A9A9A", ""),
    "unreachable": ("#F2F2F2", ""),
    "cones": ("#F2F2F2", "...."),
    "cable": ("#F2F2F2", "||||"),
    "colliding": ("#DDDDDD", "xxxx"),
    "few": ("#F2F2F2", "////"),
    "blind": ("#F2F2F2", "++++"),
}
SHORT: dict[Status, str] = {
    "blocked": "no room for fixture or stand",
    "unreachable": "out of reach",
    "cones": "ball joints tilt too far",
    "cable": "cable twisted too far",
    "colliding": "all poses collide",
    "few": "too few poses",
    "blind": "sees fewer parameters",
}


def map_png(places: FixtureMap) -> bytes:
    """Two grids of places, coloured by the index; the present and the best place marked."""
    values = [p.value for p in places.usable]
    low, high = min(values), max(values)
    norm = LogNorm(low, high if high > low else 1.01 * low)
    colours = "viridis" if RULES[places.index].maximise else "viridis_r"
    with style():
        figure = Figure(figsize=(12.5, 6.4), layout="constrained")
        level, upright = figure.subplots(1, 2)
        mappable = ScalarMappable(norm, colours)
        used = _cells(level, places, "level", mappable) | _cells(upright, places, "upright", mappable)
        _dress(level, upright, places)
        better = "higher" if RULES[places.index].maximise else "lower"
        bar = figure.colorbar(mappable, ax=[level, upright], shrink=0.85, aspect=35, extend="neither")
        bar.set_label(f"{places.index} with {places.poses} poses ({better} is better)")
        ticks = np.unique([float(f"{v:.2g}") for v in np.geomspace(norm.vmin or low, norm.vmax or high, 6)[1:-1]])
        bar.set_ticks([low, *ticks, high], labels=[number(v) for v in (low, *ticks, high)])
        bar.minorticks_off()
        handles = [Line2D([], [], marker="o", color="black", markerfacecolor="white", linestyle="", markersize=9, label="present place")]
        handles.append(Line2D([], [], marker="*", color="black", markerfacecolor="white", linestyle="", markersize=14, label="best place"))
        patches = [Patch(facecolor=HATCH[s][0], hatch=HATCH[s][1], edgecolor="#777777", label=SHORT[s]) for s in SAYS if s in used]
        figure.legend(handles=[*handles, *patches], loc="outside lower center", ncols=5)
        figure.suptitle(_title(places), x=0.01, ha="left", fontsize=11)
        return png(figure)


def _title(places: FixtureMap) -> str:
    best, present = places.best, places.present
    if best is present:
        return f"No place of the grid is better than the present one: {places.index} {number(present.value)}"
    gain = improvement(places.index, best.value, present.value)
    side = "higher" if RULES[places.index].maximise else "lower"
    return f"A fixture at {place_in_words(best.p_BX)} would make {places.index} {gain:.0f} % {side}: {number(best.value)} instead of {number(present.value)}"


def _cells(ax: Axes, places: FixtureMap, plane: Plane, colours: ScalarMappable) -> set[Status]:
    half_up = places.half[0] if plane == "level" else places.half[1]
    half_along = places.half[0] if plane == "level" else places.half[0] / 2
    used: set[Status] = set()
    for p in places.places:
        if p.plane != plane:
            continue
        corner = (p.along - half_along, p.up - half_up)
        size = (2 * half_along, 2 * half_up)
        if p.status == "usable":
            colour = colours.to_rgba(p.value)  # type: ignore[call-overload]
            ax.add_patch(Rectangle(corner, *size, facecolor=colour, edgecolor="white", linewidth=1.0))
            dark = 0.3 * colour[0] + 0.59 * colour[1] + 0.11 * colour[2] < 0.5
            ax.annotate(number(p.value), (p.along, p.up), ha="center", va="center", fontsize=7.5, color="white" if dark else "black")
        else:
            face, hatch = HATCH[p.status]
            ax.add_patch(Rectangle(corner, *size, facecolor=face, hatch=hatch, edgecolor="#BBBBBB", linewidth=0.6))
            used.add(p.status)
    return used


def _dress(level: Axes, upright: Axes, places: FixtureMap) -> None:
    present, best, far = places.present, places.best, places.reach
    level.add_patch(Circle((0, 0), far, fill=False, edgecolor="#777777", linewidth=0.8, linestyle="--"))
    level.annotate("axis 1", (0, 0), ha="center", va="center", fontsize=8)
    level.annotate(f"reach {far:.2f} m", (0.71 * far, -0.71 * far), (6, -4), textcoords="offset points", va="top", fontsize=8)
    level.set(xlabel="x (m)", ylabel="y (m)", title=f"Level, at the fixture's height, {present.p_BX[2] / MM:.0f} mm", aspect="equal")
    upright.set(xlabel="distance from axis 1 (m)", ylabel="height z (m)", aspect="equal")
    upright.set_title("Upright, through axis 1 and the fixture")
    edge = far * 1.04 + places.half[0]
    level.set(xlim=(-edge, edge), ylim=(-edge, edge))
    ups = [p.up for p in places.places if p.plane == "upright"]
    upright.set(xlim=(0, edge), ylim=(min(ups) - places.half[1] - 0.05, max(ups) + places.half[1] + 0.05))
    spots = {"level": (present.p_BX[0], present.p_BX[1]), "upright": (present.along, present.up)}
    for ax, plane in ((level, "level"), (upright, "upright")):
        ax.plot(*spots[plane], "o", color="black", markerfacecolor="white", markersize=8)
        if best.plane == plane:
            ax.plot(best.along, best.up + 0.06, "*", color="black", markerfacecolor="white", markersize=13)


def fixtures_png(fixtures: Fixtures, index: str) -> bytes:
    """What each number of fixtures sees, and which remedy shows each parameter that stays unseen."""
    unseen = [d.name for d in fixtures.steps[0].dropped]
    with style():
        figure = Figure(figsize=(11.0, max(3.6, 2.4 + 0.28 * len(unseen))), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.7])
        _steps(left, fixtures, index)
        _remedies(right, fixtures, unseen)
        return png(figure)


def _steps(ax: Axes, fixtures: Fixtures, index: str) -> None:
    at = [s.fixtures for s in fixtures.steps]
    robot, all_seen = [s.robot_seen for s in fixtures.steps], [s.seen for s in fixtures.steps]
    ax.bar(at, robot, width=0.6, color=BLUE, label="the robot's own")
    rest = [a - b for a, b in zip(all_seen, robot, strict=True)]
    ax.bar(at, rest, bottom=robot, width=0.6, color="#A6CEE3", label="fixtures, tool, zero")
    lost = [s.parameters - s.seen for s in fixtures.steps]
    ax.bar(at, lost, bottom=all_seen, width=0.6, color="none", edgecolor=GREY, hatch="////", label="not seen")
    top = max(s.parameters for s in fixtures.steps)
    for s in fixtures.steps:
        ax.annotate(f"{index} {number(s.value)}", (s.fixtures, s.parameters), (0, 3), textcoords="offset points", ha="center", fontsize=8.5)
        ax.annotate(str(s.robot_seen), (s.fixtures, s.robot_seen / 2), ha="center", va="center", color="white")
    ax.set_xticks(at)
    ax.set_ylim(0, 1.35 * top)
    ax.set(xlabel=f"number of fixtures (above: {index} of the robot's own)", ylabel="parameters")
    one = fixtures.needed == 1
    ax.set_title("One fixture sees all that fixtures can show" if one else f"{fixtures.needed} fixtures see all that fixtures can show")
    ax.legend(loc="upper left", ncols=2, fontsize=8.5)


def _remedies(ax: Axes, fixtures: Fixtures, unseen: list[str]) -> None:
    columns = [(f"{s.fixtures} fixtures", {n for t in fixtures.steps[: k + 2] for n in t.becomes}) for k, s in enumerate(fixtures.steps[1:])]
    columns += [(r.name, set(r.shows)) for r in fixtures.remedies]
    for x, (_, shown) in enumerate(columns):
        for y, name in enumerate(unseen):
            if name in shown:
                ax.plot(x, y, "o", color=BLUE, markersize=9)
            else:
                ax.plot(x, y, "x", color="#B5B5B5", markersize=5)
    never = {d.name for d in fixtures.never}
    for y, name in enumerate(unseen):
        if name in never:
            ax.axhspan(y - 0.45, y + 0.45, color=RED, alpha=0.12, linewidth=0)
            ax.annotate("never", (len(columns) - 0.5, y), (3, 0), textcoords="offset points", va="center", color=RED, annotation_clip=False)
    ax.set_xticks(range(len(columns)), [_wrapped(c) for c, _ in columns], fontsize=8.5)
    ax.set_yticks(range(len(unseen)), unseen)
    ax.set_xlim(-0.5, len(columns) - 0.5)
    ax.set_ylim(len(unseen) - 0.5, -0.5)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    hidden = len(unseen) - len(never)
    ax.set_title(f"{hidden} of {len(unseen)} unseen parameters have a remedy (filled: it shows the parameter)" if unseen else "Nothing stays unseen")


def _wrapped(text: str) -> str:
    """Break a column's head over short lines."""
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) > 13:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)
