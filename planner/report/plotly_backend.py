"""Draws a chart for the page: plotly figures as JSON, the same bytes every time."""

from math import log10

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from planner.report.chart import BASE, BLUE, RED, Chart, ColourField, Heatmap, Panel, ReferenceLine, Series

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
INK, GRID_COLOUR = "#222222", "#E4E4E4"
PAGE = {"template": None, "paper_bgcolor": "white", "font": {"family": FONT, "size": 14, "color": INK}}
GAP = 78  # [px] between two panels, room for a label and the next title
TOP, BOTTOM, LEFT, RIGHT = 36, 52, 74, 30
ASIDE = 0.16  # part of the width between panels side by side, for each of them
LOG = {"type": "log", "dtick": 1, "exponentformat": "power"}
AXIS = {"showline": True, "linecolor": "#999999", "ticks": "outside", "tickcolor": "#999999", "zeroline": False}


def chart_json(chart: Chart) -> str:
    """Return the plotly figure of a chart as JSON."""
    figure = _polar_figure(chart.panels[0]) if chart.panels[0].rings else _figure(chart)
    return str(figure.to_json())


def _figure(chart: Chart) -> go.Figure:
    many, heights = chart.columns, [max(p.height for p in row) for row in chart.rows]
    inner = sum(heights) + GAP * (len(heights) - 1)
    fig = make_subplots(
        rows=len(heights),
        cols=many,
        row_heights=heights,
        vertical_spacing=GAP / inner,
        **({"horizontal_spacing": ASIDE / many} if many > 1 else {}),
        subplot_titles=[p.title for p in chart.panels],
    )
    left = max([LEFT, *(14 + 7 * len(name) for p in chart.panels for name in p.y_names)])
    fig.update_layout(
        **PAGE,
        height=inner + TOP + BOTTOM,
        margin={"l": left, "r": RIGHT, "t": TOP, "b": BOTTOM},
        plot_bgcolor="white",
        hovermode="closest",
        hoverlabel={"bgcolor": "white", "font": {"family": FONT, "size": 13}},
        bargap=0.35,
    )
    titled = [k for k, panel in enumerate(chart.panels) if panel.title]  # plotly notes no empty titles
    for k, note in zip(titled, fig.layout.annotations, strict=True):
        left = 0 if many == 1 else next(fig.select_xaxes(row=k // many + 1, col=k % many + 1)).domain[0]
        note.update(x=left, xanchor="left", font_size=15)
    named: set[str] = set()
    for k, panel in enumerate(chart.panels):
        _draw(fig, panel, k, many, named)
    return fig


def _polar_figure(panel: Panel) -> go.Figure:
    ring, rings = panel.rings, (panel.rings * np.array([-2, 0, 2])).tolist()
    fig = go.Figure()
    for s in panel.series:
        hover = {"hovertext": s.hover, "hoverinfo": "text"} if s.hover else {"hoverinfo": "skip"}
        fig.add_trace(go.Scatterpolar(theta=s.x, r=s.y, mode="lines", name=s.name, line=_line(s), **hover))
    radial = {
        "range": [-BASE * ring, 3.4 * ring],
        "tickvals": rings,
        "ticktext": [f"{r:+g} {panel.y_label}" if r else "0" for r in rings],
        "gridcolor": GRID_COLOUR,
        "angle": 22.5,
        "tickangle": 0,
        "tickfont": {"size": 11},
    }
    angular = {"gridcolor": "#EEEEEE", "linecolor": "#CCCCCC", "ticksuffix": "°"}
    polar = {"bgcolor": "white", "angularaxis": angular, "radialaxis": radial}
    return fig.update_layout(**PAGE, height=panel.height, margin={"l": 40, "r": 40, "t": 30, "b": 30}, polar=polar)


def _draw(fig: go.Figure, panel: Panel, k: int, many: int, named: set[str]) -> None:
    """Draw panel number ``k`` of a chart with so ``many`` side by side."""
    cell = {"row": k // many + 1, "col": k % many + 1}
    legend = "legend" if k == 0 else f"legend{k + 1}"
    for series in panel.series:
        show = len(panel.series) > 1 and bool(series.name) and series.name not in named
        named.add(series.name)
        fig.add_trace(_trace(series, show).update(legend=legend), **cell)
    if panel.cells is not None:
        fig.add_trace(_heatmap(panel, panel.cells), **cell)
    top = next(fig.select_yaxes(**cell)).domain[1]
    right = 1 if many == 1 else next(fig.select_xaxes(**cell)).domain[1]
    if panel.field is not None:
        fig.add_trace(_field(panel.field, right, top), **cell)
        fig.data = (fig.data[-1], *fig.data[:-1])  # points lie on it
    place = {"orientation": "h", "x": right, "xanchor": "right", "y": top, "yanchor": "bottom"}
    fig.update_layout({legend: place | {"itemsizing": "constant"}})
    for line in panel.limits:
        _reference_line(fig, panel, line, cell)
    _axes(fig, panel, cell)


def _axes(fig: go.Figure, panel: Panel, cell: dict[str, int]) -> None:
    along: dict[str, object] = {"range": _log(panel.x_range) if panel.log_x else panel.x_range}
    if panel.cells is not None:
        along |= _names(panel.cells.x_names) | {"tickangle": -90}
    elif panel.log_x:
        along |= LOG
    fig.update_xaxes(
        **cell,
        **along,
        **AXIS,
        title={"text": panel.x_label, "standoff": 8},
        showgrid=bool(panel.y_names),
        gridcolor=GRID_COLOUR,
    )
    down: dict[str, object] = {"range": _log(panel.y_range) if panel.log_y else panel.y_range}
    if panel.y_names:
        down = {"range": [len(panel.y_names) - 0.4, -0.6], **_names(panel.y_names)}
    if panel.log_y:
        down |= LOG
    fig.update_yaxes(
        **cell, **down, **AXIS, title_text=panel.y_label, showgrid=panel.cells is None, gridcolor=GRID_COLOUR
    )


def _names(names: tuple[str, ...]) -> dict[str, object]:
    return {"tickmode": "array", "tickvals": list(range(len(names))), "ticktext": list(names)}


def _log(span: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if span is None else (log10(span[0]), log10(span[1]))


def _trace(series: Series, show: bool) -> go.Scatter | go.Bar:
    common = {"name": series.name, "x": series.x, "y": series.y, "showlegend": show, "legendgroup": series.name}
    if series.hover:
        common |= {"hovertext": series.hover, "hoverinfo": "text"}
    if series.mark == "bars":
        outside = {"text": series.texts, "textposition": "outside", "cliponaxis": False, "hoverinfo": "skip"}
        return go.Bar(orientation="h", marker={"color": series.colour}, **common, **outside)
    if series.mark == "points":
        faint = {} if series.opacity == 1.0 else {"opacity": series.opacity}
        return go.Scatter(mode="markers", marker={"color": series.colour, "size": series.size} | faint, **common)
    fill = {"fill": "tozeroy", "fillcolor": f"{series.colour}33"} if series.filled else {}
    return go.Scatter(mode="lines", line=_line(series), **common, **fill)


def _line(series: Series) -> dict[str, object]:
    return {"color": series.colour, "width": series.width, "dash": "dash" if series.dashed else "solid"}


def _heatmap(panel: Panel, cells: Heatmap) -> go.Heatmap:
    texts = [
        [f"{y} and {x}: {v:+.2f}" for x, v in zip(cells.x_names, row, strict=True)]
        for y, row in zip(panel.y_names, cells.values, strict=True)
    ]
    look = {"zmin": -1, "zmax": 1, "colorscale": [[0, RED], [0.5, "#FFFFFF"], [1, BLUE]], "xgap": 1, "ygap": 1}
    bar = {"thickness": 14, "len": 0.5, "outlinewidth": 0}
    return go.Heatmap(z=cells.values, text=texts, hoverinfo="text", colorbar=bar, **look)


def _field(field: ColourField, right: float, top: float) -> go.Heatmap:
    """Draw a field whose scale of colours stands at the right of the panel that ends at ``right`` and ``top``."""
    bar = {"thickness": 10, "outlinewidth": 0, "len": 0.5, "x": right, "xpad": 4, "y": top, "yanchor": "top"}
    hover = f"%{{x:.0f}}, %{{y:.0f}}: {field.label} %{{z:.3g}}<extra></extra>"
    return go.Heatmap(
        x=field.x, y=field.y, z=field.values.astype(np.float32), colorscale="YlOrRd", colorbar=bar, hovertemplate=hover
    )


def _reference_line(fig: go.Figure, panel: Panel, line: ReferenceLine, cell: dict[str, int]) -> None:
    look = {"line_color": "#666666", "line_width": 1, "line_dash": "dot", **cell}
    if line.upright:
        fig.add_vline(x=line.at, **look)
        # on a logarithmic axis plotly places notes by the exponent
        where = {"x": log10(line.at) if panel.log_x else line.at, "y": 1, "yref": "y domain", "xanchor": "left"}
        text = {"text": line.text, "font": {"size": 13, "color": "#444444"}, "showarrow": False, "yanchor": "top"}
        fig.add_annotation(**where, **text, **cell)
        return
    note = {"annotation_text": line.text, "annotation_font_size": 13, "annotation_font_color": "#444444"}
    place = "bottom right" if line.below else "top right"
    fig.add_hline(y=line.at, annotation_position=place, **look, **note)
