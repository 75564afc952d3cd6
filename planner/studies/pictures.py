"""The study's charts: what is seen, index curves, sensitivity, correlation, how many fixtures it takes, and where."""

from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from planner.common.units import MDEG, MM, UM
from planner.design.fixtures.places import Status
from planner.design.observability.information import INDEX_RULES
from planner.report.chart import BLUE, GREY, ORANGE, RED, SKY, Chart, Heatmap, Panel, ReferenceLine, Series, log_ticks
from planner.report.matplotlib_backend import figure_png, print_style
from planner.studies.basis import BoundedCurve, StudyBasis
from planner.studies.fixture_places import FixtureMap
from planner.studies.summary import StudySummary, describe_fixtures, format_number

ROW_PX = 16  # [px] a parameter's line


def draw_identifiability(study: StudySummary) -> Chart:
    """Singular values with their gap, and each parameter's predicted standard deviation against its prior."""
    return Chart("identifiability", "What is seen", "", (_spectrum(study.basis), _prior_shares(study.basis)))


def _spectrum(basis: StudyBasis) -> Panel:
    mu, rank = basis.seen.spectrum / UM, basis.seen.rank
    mu = np.maximum(mu, mu[0] * 1e-17)
    order = np.arange(1.0, len(mu) + 1)
    parts = (("seen", slice(None, rank), BLUE), ("not seen", slice(rank, None), RED))
    series = tuple(Series(name, order[which], mu[which], colour, "points") for name, which, colour in parts)
    gap = f", a gap of {basis.seen.gap:.0e} to the rest" if rank < len(mu) and np.isfinite(basis.seen.gap) else ""
    noise = basis.noise / np.sqrt(basis.poses) / UM
    limit = ReferenceLine(noise, f"noise of a reading, mean of {basis.poses}: {format_number(noise)} µm", below=True)
    title = f"{rank} of {len(mu)} directions are seen{gap}"
    labels = "direction, strongest first", "rms change of a reading by one prior sigma (µm)"
    return Panel(title, *labels, series, (limit,), log_y=True, height=300)


def _prior_shares(basis: StudyBasis) -> Panel:
    names, carried = basis.whole.names, basis.absorbers
    why = {d.name: d.because.split(":")[0].removeprefix(f"{d.name} ") for d in basis.seen.dropped}
    std = dict(zip(basis.seen.names, basis.predicted.std.tolist(), strict=True))
    share = {p.name: 100 * std[p.name] / p.prior for p in basis.whole.parameters if p.name in std}
    texts = {
        p.name: " carries ".join([_format_in_unit(std[p.name], p.unit), *([", ".join(c)] if c else [])])
        for p in basis.whole.parameters
        if p.name in std
        for c in [carried[p.name]]
    }
    least, worst = min(share.values()), max(share, key=lambda n: share[n])
    series = [_bars("seen", [share[n] for n in texts], [names.index(n) for n in texts], BLUE, tuple(texts.values()))]
    if why:
        rows = [names.index(n) for n in why]
        series.append(_bars("not seen", [least / 3] * len(why), rows, RED, tuple(why.values())))
    return Panel(
        f"After {basis.poses} poses the least certain, {worst}, is known to {share[worst]:.0f} % of its prior",
        "predicted σ after one measurement (% of prior σ)",
        "",
        tuple(series),
        (ReferenceLine(100.0, "prior", upright=True),),
        log_x=True,
        x_range=(least / 4, max(200.0, 2 * share[worst])),
        y_names=names,
        height=ROW_PX * len(names),
    )


def _bars(name: str, x: list[float], rows: list[int], colour: str, texts: tuple[str, ...] | None = None) -> Series:
    return Series(name, np.array(x), np.array(rows, dtype=float), colour, "bars", texts=texts or ("",) * len(x))


def _format_in_unit(value: float, unit: str) -> str:
    """A length in mm or an angle in thousandths of a degree, with two digits."""
    return f"{value / MM:.2g} mm" if unit == "m" else f"{value / MDEG:.2g} mdeg"


def draw_curves(study: StudySummary) -> Chart:
    """Small multiples: one index a row, raw on the left, unit-free on the right."""
    basis = study.basis
    curves = sorted(basis.curves, key=lambda c: (c.index, c.scaled))
    own = basis.curve
    gap = 100 * INDEX_RULES[own.index].gap(own.at_knee, own.limit_at_knee)
    any_set = "any number of poses" if own.index in ("O1", "O2") else f"any {own.knee} poses"
    title = f"{own.index} bends at {own.knee} poses, where it is within {gap:.0f} % of what {any_set} can reach"
    return Chart("index_curve", title, "", tuple(_curve(c) for c in curves), columns=2)


def _curve(curve: BoundedCurve) -> Panel:
    best = "higher" if INDEX_RULES[curve.index].maximise else "lower"
    sizes = curve.sizes.astype(float)
    series = (
        Series("proven limit", sizes, curve.bounds, ORANGE, dashed=True),
        Series("selected", sizes, curve.values, BLUE),
        Series("bend", np.array([float(curve.knee)]), np.array([curve.at_knee]), RED, "points", size=9.0),
    )
    title = f"{curve.index} {curve.scaling}{'' if curve.scaled else ' (m, rad)'}"
    label = f"poses; {best} is better, bends at {curve.knee}"
    return Panel(title, label, "", series, log_x=True, height=170)


def draw_sensitivity(study: StudySummary) -> Chart:
    """Sorted bars of each parameter's effect on the reading, and the correlations at the chosen poses."""
    return Chart("sensitivity", "Sensitivity", "", (_effects(study.basis), _correlation(study.basis)))


def _effects(basis: StudyBasis) -> Panel:
    rms, most = (v / UM for v in basis.effects)
    order = np.lexsort((np.arange(len(rms)), -np.round(rms, 6)))
    names = tuple(basis.whole.names[k] for k in order)
    seen = [n in basis.seen.names for n in names]
    series = [
        _bars(name, [rms[k] for k, s in zip(order, seen, strict=True) if s == kept], _rows(seen, kept), colour)
        for name, kept, colour in (("rms, identified", True, BLUE), ("rms, held at its nominal value", False, GREY))
        if kept in seen
    ]
    largest = Series("largest of all candidates", most[order], np.arange(float(len(order))), ORANGE, "points")
    label = f"change of the reading by one prior sigma (µm); most by {names[0]}, {rms[order[0]]:.0f} µm"
    reach = (0.0, 1.05 * float(most.max()))
    return Panel("", label, "", (*series, largest), x_range=reach, y_names=names, height=ROW_PX * len(names))


def _rows(flags: list[bool], wanted: bool) -> list[int]:
    return [k for k, flag in enumerate(flags) if flag == wanted]


def _correlation(basis: StudyBasis) -> Panel:
    rho, names = basis.predicted.correlation, basis.seen.names
    loud = 0.9  # a correlation from which two parameters are hard to tell apart
    pairs = int(np.sum(np.abs(np.triu(rho, 1)) >= loud))
    says = "No two parameters are" if not pairs else f"{pairs} pair{'s are' if pairs > 1 else ' is'}"
    title = f"{says} correlated by {loud:g} or more at the {basis.poses} chosen poses"
    return Panel(title, "", "", (), y_names=names, height=ROW_PX * len(names), cells=Heatmap(rho, names))


def draw_fixtures(study: StudySummary) -> Chart:
    """What each number of fixtures sees, and which remedy shows each parameter that stays unseen."""
    fixtures = study.fixtures
    unseen = tuple(d.name for d in fixtures.steps[0].dropped)
    columns, shown = [], set[str]()
    for step in fixtures.steps[1:]:
        shown = shown | set(step.becomes)
        columns.append((f"{step.fixtures} fixtures", shown))
    columns += [(r.name, set(r.shows)) for r in fixtures.remedies]
    values = np.array([[1.0 if n in shown else 0.0 for _, shown in columns] for n in unseen]).reshape(-1, len(columns))
    never = {d.name for d in fixtures.lost_parameters}
    values[[n in never for n in unseen]] = -0.3
    hope = len(unseen) - len(never)
    title = f"{hope} of the {len(unseen)} unseen parameters can be shown in some way (blue); red: in none"
    cells = Heatmap(values, tuple(fill(head, 30) for head, _ in columns))
    remedies = Panel(title, "", "", (), y_names=unseen, height=60 + ROW_PX * len(unseen), cells=cells)
    panels = (_fixture_steps(study), *([remedies] if unseen else []))
    return Chart("fixtures_needed", "How many fixtures", "", panels)


def _against_first(value: float, first: float, index: str) -> str:
    """Say the index of the robot's own parameters against that with the fewest fixtures."""
    return "" if value == first else f"; {index} of its own {value / first:.2f} times that of the first"


def _fixture_steps(study: StudySummary) -> Panel:
    steps, index = study.fixtures.steps, study.basis.index
    rows = list(range(len(steps)))
    texts = tuple(
        f"{s.robot_seen} of the robot, {s.seen} of all {s.parameters}{_against_first(s.value, steps[0].value, index)}"
        for s in steps
    )
    series = (
        _bars("with fixtures, tool and zero", [float(s.seen) for s in steps], rows, SKY, texts),
        _bars("the robot's own", [float(s.robot_seen) for s in steps], rows, BLUE),
    )
    names = tuple(f"{s.fixtures} fixture{'s' * (s.fixtures > 1)}" for s in steps)
    label = fill(f"parameters seen; {describe_fixtures(study.fixtures, index)[0]}", 100)  # letters of a title
    reach = (0.0, 1.8 * max(s.parameters for s in steps))
    return Panel("", label, "", series, x_range=reach, y_names=names, height=150)


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
    """Return the picture of the map of places."""
    with print_style():
        return figure_png(map_figure(places))


def map_figure(places: FixtureMap) -> Figure:
    """Draw two grids of places, coloured by the ratio of their index to that of the present place.

    The present and the best place are marked. The index itself stands on the index curve alone.
    """
    values = [places.ratio(p) for p in places.usable_places]
    norm = LogNorm(min(values), max(max(values), 1.01 * min(values)))
    colours = ScalarMappable(norm, "viridis" if INDEX_RULES[places.index].maximise else "viridis_r")
    with print_style():
        figure = Figure(figsize=(12.5, 6.4), layout="constrained")
        level, upright = figure.subplots(1, 2)
        _draw_level(level, places, colours)
        _draw_upright(upright, places, colours)
        _draw_colour_bar(figure, [level, upright], places, colours)
        figure.legend(handles=_map_legend(places), loc="outside lower center", ncols=5)
        return figure


def _draw_cells(ax: Axes, places: FixtureMap, plane: str, half: tuple[float, float], colours: ScalarMappable) -> None:
    for p in (p for p in places.places if p.plane == plane):
        box = ((p.along - half[0], p.up - half[1]), 2 * half[0], 2 * half[1])
        if p.status != "usable":
            _, face, hatch = STATUS_LOOKS[p.status]
            ax.add_patch(Rectangle(*box, facecolor=face, hatch=hatch, edgecolor="#BBBBBB", linewidth=0.6))
            continue
        red, green, blue, _ = np.asarray(colours.to_rgba(np.array([places.ratio(p)])))[0]
        ax.add_patch(Rectangle(*box, facecolor=(red, green, blue), edgecolor="white", linewidth=1.0))
        ink = "white" if 0.3 * red + 0.59 * green + 0.11 * blue < 0.5 else "black"
        ax.annotate(f"{places.ratio(p):.2f}", (p.along, p.up), ha="center", va="center", fontsize=7.5, color=ink)


def _draw_level(ax: Axes, places: FixtureMap, colours: ScalarMappable) -> None:
    half, far, here = places.half[0], places.reach, places.present.p_BX
    _draw_cells(ax, places, "level", (half, half), colours)
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
    _draw_cells(ax, places, "upright", (along, up), colours)
    ax.set(xlabel="distance from axis 1 (m)", ylabel="height z (m)", aspect="equal")
    ax.set_title("Upright, through axis 1 and the present fixture")
    ups = [p.up for p in mine]
    ax.set(xlim=(0, places.reach * 1.04 + along), ylim=(min(ups) - up - 0.05, max(ups) + up + 0.05))
    _draw_marks(ax, places, "upright", (places.present.along, places.present.up))


def _draw_marks(ax: Axes, places: FixtureMap, plane: str, present: tuple[float, float]) -> None:
    best, half = places.best_place, places.half[0] if plane == "level" else places.half[1]
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
    bar.set_label(f"{places.index} over that of the present place, {places.poses} poses ({better} is better)")
    inside = {v: text for v, text in zip(*log_ticks((low, high), "10^{}"), strict=True) if low <= v <= high}
    bar.set_ticks(list(inside), labels=list(inside.values()))
    bar.minorticks_off()


def _map_legend(places: FixtureMap) -> list[Line2D | Patch]:
    marks = [Line2D([], [], label=name, linestyle="", **look) for name, look in MARKS.items()]
    used = {p.status for p in places.places}
    looks = [look for status, look in STATUS_LOOKS.items() if status in used]
    return [*marks, *(Patch(facecolor=f, hatch=h, edgecolor="#777777", label=says) for says, f, h in looks)]
