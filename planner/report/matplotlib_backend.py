"""Draws a picture for print: PNGs by matplotlib's own renderer, without screen, clock or user settings."""

from contextlib import AbstractContextManager
from io import BytesIO
from typing import Any

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from planner.report.chart import BLUE, RED, Chart, Heatmap, Panel, ReferenceLine, Series

WIDTH, DPI, PX = 8.0, 160, 1 / 80  # [inch], dots an inch, inch a pixel of the page
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


def figure_png(figure: Figure) -> bytes:
    """Return the PNG of a figure without date or program name."""
    FigureCanvasAgg(figure)
    out = BytesIO()
    figure.savefig(out, format="png", dpi=DPI, metadata={"Software": None})
    return out.getvalue()


def chart_png(picture: Chart) -> bytes:
    """Return the PNG of a picture: panels in rows."""
    many = picture.columns
    rows = [picture.panels[k : k + many] for k in range(0, len(picture.panels), many)]
    heights = [max(p.height for p in row) * PX for row in rows]
    with print_style():
        tall = sum(heights) + 0.75 * len(heights) + 0.1
        figure = Figure(figsize=(WIDTH, tall), layout="constrained" if many == 1 else None)
        axes = figure.subplots(len(heights), many, height_ratios=heights, squeeze=False).ravel()
        named: set[str] = set()
        for ax, panel in zip(axes, picture.panels, strict=False):
            _draw(ax, panel, named)
        if many > 1:  # of one size each, so their room need not be found out
            margin = {"left": 0.075, "right": 0.99, "bottom": 0.5 / tall, "top": 1 - 0.3 / tall}
            figure.subplots_adjust(**margin, wspace=0.2, hspace=0.68 * len(heights) / sum(heights))
        for ax in axes[len(picture.panels) :]:
            ax.set_axis_off()
        return figure_png(figure)


def _draw(ax: Axes, panel: Panel, named: set[str]) -> None:
    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    if panel.log_x:
        ax.set_xscale("log")
    if panel.log_y:
        ax.set_yscale("log")
    if panel.cells is not None:
        _field(ax, panel.cells)
    for series in panel.series:
        _series(ax, series, "" if series.name in named else series.name)
        named.add(series.name)
    for limit in panel.limits:
        _limit(ax, limit)
    if panel.x_range is not None:
        ax.set_xlim(*panel.x_range)
    if panel.y_names:
        ax.set_yticks(range(len(panel.y_names)), panel.y_names)
        ax.set_ylim(len(panel.y_names) - 0.4, -0.6)
    elif panel.y_range is not None:
        ax.set_ylim(*panel.y_range)
    ax.grid(visible=panel.cells is None, axis="x" if panel.y_names else "y")
    labels = ax.get_legend_handles_labels()[1]
    if len(panel.series) > 1 and labels:
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(labels), borderaxespad=0.1, columnspacing=1.2)


def _series(ax: Axes, series: Series, name: str) -> None:
    label = name or "_unnamed"
    if series.mark == "bars":
        ax.barh(series.y, series.x, height=0.65, color=series.colour, label=label)
        for x, y, text in zip(series.x, series.y, series.texts, strict=True):
            ax.annotate(text, (x, y), (4, 0), textcoords="offset points", va="center")
    elif series.mark == "points":
        ax.plot(
            series.x,
            series.y,
            "o",
            color=series.colour,
            markersize=series.size * 4.5 / 7,
            label=label,
            **_faint(series),
        )
    else:
        dash = "--" if series.dashed else "-"
        ax.plot(series.x, series.y, dash, color=series.colour, linewidth=series.width * 0.8, label=label)
        if series.filled:
            ax.fill_between(series.x, series.y, color=series.colour, alpha=0.2, linewidth=0)


def _faint(series: Series) -> dict[str, Any]:
    return {} if series.opacity == 1.0 else {"alpha": series.opacity, "markeredgewidth": 0}


def _field(ax: Axes, cells: Heatmap) -> None:
    colours = LinearSegmentedColormap.from_list("signed", [RED, "#FFFFFF", BLUE])
    field = ax.imshow(cells.values, cmap=colours, vmin=-1, vmax=1, aspect="auto")
    ax.set_xticks(range(len(cells.x_names)), cells.x_names, rotation=90)
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(field, ax=ax, shrink=0.5, aspect=25)


def _limit(ax: Axes, limit: ReferenceLine) -> None:
    if limit.upright:
        ax.axvline(limit.at, color=LINE_COLOUR, linewidth=0.8, linestyle=":")
        ax.annotate(
            limit.text, (limit.at, 1), (3, -3), xycoords=ax.get_xaxis_transform(), textcoords="offset points", va="top"
        )
        return
    ax.axhline(limit.at, color=LINE_COLOUR, linewidth=0.8, linestyle=":")
    down = -3 if limit.below else 3
    ax.annotate(
        limit.text,
        (1, limit.at),
        (0, down),
        xycoords=ax.get_yaxis_transform(),
        textcoords="offset points",
        ha="right",
        va="top" if limit.below else "bottom",
        color="#444444",
    )
