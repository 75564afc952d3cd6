"""Draws a picture for print: PNGs by matplotlib's own renderer, without screen, clock or user settings."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import partial
from io import BytesIO
from math import ceil
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from PIL import Image

from planner.common.errors import InputError
from planner.common.result import Plot
from planner.report.chart import (
    BLUE,
    FIELD_SCALE,
    POLAR_BASE,
    RED,
    Chart,
    ColourField,
    Heatmap,
    Panel,
    ReferenceLine,
    Series,
    Span,
    log_ticks,
)

DPI = 160  # dots an inch
LINE_COLOUR = "#666666"
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "axes.edgecolor": "#888888",
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "text.color": "#222222",
    "legend.frameon": False,
    "svg.hashsalt": "edbb",
}


def print_style() -> AbstractContextManager[None]:
    """Our own look, whatever the user's settings file says."""
    return matplotlib.style.context(STYLE, after_reset=True)


def figure_png(figure: Figure, small: bool = False) -> bytes:
    """Return the PNG of a figure without date or program name; a small one has a palette of few colours."""
    FigureCanvasAgg(figure)
    out = BytesIO()
    packed = {"compress_level": 1 if small else 4}  # a small one is packed again; the usual 6 takes twice as long
    figure.savefig(out, format="png", dpi=DPI, metadata={"Software": None}, pil_kwargs=packed)
    if not small:
        return out.getvalue()
    # 128: colours of a small picture
    few = Image.open(out).convert("RGB").quantize(128, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    reduced = BytesIO()
    few.save(reduced, "PNG")
    return reduced.getvalue()


def chart_png(chart: Chart) -> bytes:
    """Return the PNG of a chart: panels in rows."""
    with print_style():
        return figure_png(chart_figure(chart))


def chart_plot(chart: Chart) -> Plot:
    """Return the plot of a chart, whose figure a person may go on with."""
    return Plot(chart.name, chart_png(chart), partial(chart_figure, chart))


def find_plot(charts: Sequence[Chart], name: str) -> Plot:
    """Return the plot of the chart of that name.

    Raises:
        InputError: no such chart.
    """
    found = {chart.name: chart for chart in charts}
    if name not in found:
        raise InputError(f"no chart '{name}' (there: {', '.join(found)})")
    return chart_plot(found[name])


def chart_figure(chart: Chart) -> Figure:
    """Return the figure of a chart, with an axes for each panel."""
    width_inch = 8.0  # [inch] of a chart
    polar_inch = 6.4  # [inch] of a polar chart
    many = min(chart.columns, len(chart.panels))
    heights = [max(p.height for p in row) * (1 / 80) for row in chart.rows]  # [inch] a pixel of the page
    polar = any(p.rings for p in chart.panels)
    with print_style():
        tall = sum(heights) + 0.75 * len(heights) + 0.1
        size = (polar_inch, polar_inch) if polar else (width_inch, tall)
        figure = Figure(figsize=size, dpi=DPI, layout="constrained" if many == 1 else None)
        kind = {"projection": "polar"} if polar else None
        axes = figure.subplots(len(heights), many, height_ratios=heights, squeeze=False, subplot_kw=kind).ravel()
        named: set[str] = set()
        drawn = zip(axes, chart.panels, strict=False)
        heads = [_draw(ax, panel, named, width_inch / many - 0.75) for ax, panel in drawn]  # [inch] beside a panel
        if many > 1:  # of one size each, so their room need not be found out
            left = 0.105 if any(p.y_label for p in chart.panels[::many]) else 0.085
            right, between = 0.99, 0.2
            if letters := max(_scale_letters(ax) for ax in axes):  # a scale has numbers of its own
                room = (0.1 + 0.067 * letters) / width_inch  # 0.067 [inch] a letter, 0.1 [inch] before them
                right, between = right - room, 0.3 + 4 * room
            above = max(heads[:many])
            tall += above
            figure.set_size_inches(width_inch, tall)
            margin = {"left": left, "right": right, "bottom": 0.5 / tall, "top": 1 - (0.3 + above) / tall}
            figure.subplots_adjust(**margin, wspace=between, hspace=0.68 * len(heights) / sum(heights))
        for ax in axes[len(chart.panels) :]:
            ax.set_axis_off()
        FigureCanvasAgg(figure)
        if engine := figure.get_layout_engine():  # once: savefig would lay out and draw twice
            engine.execute(figure)
            figure.set_layout_engine("none")
        return figure


def _draw(ax: Axes, panel: Panel, named: set[str], room: float) -> float:
    """Draw a panel; return how much more than a line its head is high [inch]."""
    if panel.log_x:
        ax.set_xscale("log")
    if panel.log_y:
        ax.set_yscale("log")
    if panel.cells is not None:
        _heatmap(ax, panel.cells)
    if panel.field is not None:
        _field(ax, panel.field)
    for series in panel.series:
        _series(ax, series, "" if series.name in named else series.name, polar=panel.rings > 0)
        named.add(series.name)
    if panel.rings:
        ax.set_title(panel.title)
        _polar_axes(ax, panel.rings)
        return 0.0
    for line in panel.limits:
        _reference_line(ax, line)
    _axes(ax, panel)
    return _head(ax, panel, ax.get_legend_handles_labels()[1] if len(panel.series) > 1 else [], room)


def _head(ax: Axes, panel: Panel, labels: Sequence[str], room: float) -> float:
    """Title and legend in one line where they have room [inch] beside each other, else one above the other.

    Returns by how much more than a line they are high [inch].
    """
    letter_inch = 0.073  # [inch] a letter
    left = letter_inch * max((len(n) for n in panel.y_names), default=0)
    wide = sum(0.46 + letter_inch * len(text) for text in labels)  # [inch] what stands beside a text in a legend
    lines = ceil(wide / (room - left))
    beside = lines < 2 and wide + letter_inch * len(panel.title) < room - left
    line_pt = 15  # [pt] a line of a legend
    ax.set_title(panel.title, pad=None if beside else 6 + line_pt * lines)
    if labels:
        columns = ceil(len(labels) / lines)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=columns, borderaxespad=0.1, columnspacing=1.2)
    return 0.0 if beside else line_pt * lines / 72


def _set_log_ticks(axis: Any, span: Span) -> None:
    axis.set_ticks(*log_ticks(span, "$10^{{{}}}$"))
    axis.set_minor_formatter(NullFormatter())


def _axes(ax: Axes, panel: Panel) -> None:
    ax.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.log_x:
        seen = ax.get_xlim()
        _set_log_ticks(ax.xaxis, panel.log_span("x"))
        ax.set_xlim(*seen)
    if panel.log_y:
        seen = ax.get_ylim()
        _set_log_ticks(ax.yaxis, panel.log_span("y"))
        ax.set_ylim(*seen)
    if panel.x_range is not None:
        ax.set_xlim(*panel.x_range)
    if panel.y_names:
        ax.set_yticks(range(len(panel.y_names)), panel.y_names)
        ax.set_ylim(len(panel.y_names) - 0.4, -0.6)
    elif panel.y_range is not None:
        ax.set_ylim(*panel.y_range)
    ax.grid(visible=panel.cells is None, axis="x" if panel.y_names else "y")


def _polar_axes(ax: Any, ring: float) -> None:
    rings = ring * np.arange(-3, 4)
    ax.set_rorigin(-POLAR_BASE * ring)
    ax.set_rlim(-3.4 * ring, 3.4 * ring)
    ax.set_rgrids(rings, [f"{r:+g}" if r else "0" for r in rings], angle=22.5, fontsize=8)
    ax.legend(loc="center", fontsize=9)


def _series(ax: Axes, series: Series, name: str, polar: bool) -> None:
    x = np.deg2rad(series.x) if polar else series.x
    look: dict[str, Any] = {"color": series.colour, "label": name or "_unnamed"}
    if series.mark == "bars":
        ax.barh(series.y, x, height=0.65, **look)
        for at, y, text in zip(x, series.y, series.texts, strict=True):
            ax.annotate(text, (at, y), (4, 0), textcoords="offset points", va="center")
    elif series.mark == "points":
        faint: dict[str, Any] = {} if series.opacity == 1.0 else {"alpha": series.opacity, "markeredgewidth": 0}
        ax.plot(x, series.y, "o", markersize=series.size * 4.5 / 7, **look, **faint)
    else:
        ax.plot(x, series.y, "--" if series.dashed else "-", linewidth=series.width * 0.8, **look)
        if series.filled:
            ax.fill_between(x, series.y, color=series.colour, alpha=0.2, linewidth=0)


def _heatmap(ax: Axes, cells: Heatmap) -> None:
    colours = LinearSegmentedColormap.from_list("signed", [RED, "#FFFFFF", BLUE])
    image = ax.imshow(cells.values, cmap=colours, vmin=-1, vmax=1, aspect="auto")
    ax.set_xticks(range(len(cells.x_names)), cells.x_names, rotation=90)
    ax.figure.colorbar(image, ax=ax, shrink=0.5, aspect=25)


def _field(ax: Axes, field: ColourField) -> None:
    values = np.ma.masked_invalid(field.values)
    low, high = field.span
    colours = LinearSegmentedColormap.from_list("field", list(FIELD_SCALE))
    image = ax.pcolormesh(field.x, field.y, values, cmap=colours, vmin=low, vmax=high, shading="nearest")
    bar = ax.figure.colorbar(image, ax=ax, fraction=0.05, pad=0.03)
    at, texts = field.ticks
    bar.set_ticks(at, labels=texts)
    bar.ax.tick_params(labelsize=8)
    bar.ax.spines["outline"].set_visible(False)


def _scale_letters(ax: Axes) -> int:
    """Return how many letters the longest number at the scale of a field has, 0 where there is none."""
    scales = [c.colorbar for c in ax.collections if c.colorbar is not None]
    return max((len(t) for s in scales for t in s.formatter.format_ticks(s.get_ticks().tolist())), default=0)


def _reference_line(ax: Axes, line: ReferenceLine) -> None:
    look: dict[str, Any] = {"color": LINE_COLOUR, "linewidth": 0.8, "linestyle": ":"}
    note: dict[str, Any]
    if line.upright:
        ax.axvline(line.at, **look)
        place, note = (line.at, 1.0), {"xytext": (3, -3), "xycoords": ax.get_xaxis_transform(), "va": "top"}
    else:
        ax.axhline(line.at, **look)
        side = {"va": "top", "xytext": (0, -3)} if line.below else {"va": "bottom", "xytext": (0, 3)}
        place, note = (1.0, line.at), {"xycoords": ax.get_yaxis_transform(), "ha": "right", "color": "#444444", **side}
    ax.annotate(line.text, place, textcoords="offset points", **note)
