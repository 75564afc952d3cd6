"""Draws a picture for the page: plotly figures as JSON, the same bytes every time."""

from math import log10

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from planner.report.chart import BLUE, RED, Chart, Heatmap, Panel, ReferenceLine, Series

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
INK, GRID_COLOUR = "#222222", "#E4E4E4"
GAP = 78  # [px] between two panels, room for a label and the next title
TOP, BOTTOM, LEFT, RIGHT = 36, 52, 74, 30
ASIDE = 0.16  # part of the width between panels side by side, for each of them
LOG = {"type": "log", "dtick": 1, "exponentformat": "power"}


def chart_json(picture: Chart) -> str:
    """Return the plotly figure of a picture as JSON."""
    return str(plotly_figure(picture).to_json())


def plotly_figure(picture: Chart) -> go.Figure:
    """Return the plotly figure of a picture: panels in rows."""
    many = picture.columns
    heights = [max(p.height for p in picture.panels[k : k + many]) for k in range(0, len(picture.panels), many)]
    inner = sum(heights) + GAP * (len(heights) - 1)
    fig = make_subplots(
        rows=len(heights),
        cols=many,
        row_heights=heights,
        vertical_spacing=GAP / inner,
        **({"horizontal_spacing": ASIDE / many} if many > 1 else {}),
        subplot_titles=[p.title for p in picture.panels],
    )
    left = max([LEFT, *(14 + 7 * len(name) for p in picture.panels for name in p.y_names)])
    fig.update_layout(
        template=None,
        height=inner + TOP + BOTTOM,
        margin={"l": left, "r": RIGHT, "t": TOP, "b": BOTTOM},
        font={"family": FONT, "size": 14, "color": INK},
        paper_bgcolor="white",
        plot_bgcolor="white",
        hovermode="closest",
        hoverlabel={"bgcolor": "white", "font": {"family": FONT, "size": 13}},
        bargap=0.35,
    )
    titled = [k for k, panel in enumerate(picture.panels) if panel.title]  # plotly notes no empty titles
    for k, note in zip(titled, fig.layout.annotations, strict=True):
        left = 0 if many == 1 else next(fig.select_xaxes(row=k // many + 1, col=k % many + 1)).domain[0]
        note.update(x=left, xanchor="left", font_size=15)
    named: set[str] = set()
    for k, panel in enumerate(picture.panels):
        _draw(fig, panel, k, many, named)
    return fig


def _draw(fig: go.Figure, panel: Panel, k: int, many: int, named: set[str]) -> None:
    """Draw panel number ``k`` of a picture with so ``many`` side by side."""
    cell = {"row": k // many + 1, "col": k % many + 1}
    several = len(panel.series) > 1
    legend = "legend" if k == 0 else f"legend{k + 1}"
    for series in panel.series:
        show = several and bool(series.name) and series.name not in named
        named.add(series.name)
        fig.add_trace(_trace(series, show).update(legend=legend), **cell)
    if panel.cells is not None:
        fig.add_trace(_field(panel, panel.cells), **cell)
    top = next(fig.select_yaxes(**cell)).domain[1]
    right = 1 if many == 1 else next(fig.select_xaxes(**cell)).domain[1]
    place = {"orientation": "h", "x": right, "xanchor": "right", "y": top, "yanchor": "bottom"}
    fig.update_layout({legend: place | {"itemsizing": "constant"}})
    for limit in panel.limits:
        _limit(fig, panel, limit, cell)
    _axes(fig, panel, cell)


def _axes(fig: go.Figure, panel: Panel, cell: dict[str, int]) -> None:
    axis = {"showline": True, "linecolor": "#999999", "ticks": "outside", "tickcolor": "#999999", "zeroline": False}
    along = _columns(panel.cells) if panel.cells else LOG if panel.log_x else {}
    fig.update_xaxes(
        title_text=panel.x_label,
        title_standoff=8,
        showgrid=bool(panel.y_names),
        gridcolor=GRID_COLOUR,
        range=_log(panel.x_range) if panel.log_x else panel.x_range,
        **cell,
        **along,
        **axis,
    )
    names = {"tickmode": "array", "tickvals": list(range(len(panel.y_names))), "ticktext": list(panel.y_names)}
    down: dict[str, object] = {"range": _log(panel.y_range) if panel.log_y else panel.y_range}
    if panel.y_names:
        down = {"range": [len(panel.y_names) - 0.4, -0.6], **names}
    if panel.log_y:
        down |= LOG
    fig.update_yaxes(
        title_text=panel.y_label, showgrid=panel.cells is None, gridcolor=GRID_COLOUR, **cell, **down, **axis
    )


def _trace(series: Series, show: bool) -> go.Scatter | go.Bar:
    common = {"name": series.name, "x": series.x, "y": series.y, "showlegend": show, "legendgroup": series.name}
    if series.hover:
        common |= {"hovertext": series.hover, "hoverinfo": "text"}
    if series.mark == "bars":
        outside = {"text": series.texts, "textposition": "outside", "cliponaxis": False, "hoverinfo": "skip"}
        return go.Bar(orientation="h", marker={"color": series.colour}, **common, **outside)
    if series.mark == "points":
        return go.Scatter(
            mode="markers", marker={"color": series.colour, "size": series.size} | _faint(series), **common
        )
    line = {"color": series.colour, "width": series.width, "dash": "dash" if series.dashed else "solid"}
    fill = {"fill": "tozeroy", "fillcolor": f"{series.colour}33"} if series.filled else {}
    return go.Scatter(mode="lines", line=line, **common, **fill)


def _faint(series: Series) -> dict[str, float]:
    return {} if series.opacity == 1.0 else {"opacity": series.opacity}


def _field(panel: Panel, cells: Heatmap) -> go.Heatmap:
    return go.Heatmap(
        z=cells.values,
        zmin=-1,
        zmax=1,
        colorscale=[[0, RED], [0.5, "#FFFFFF"], [1, BLUE]],
        xgap=1,
        ygap=1,
        text=[
            [f"{y} and {x}: {v:+.2f}" for x, v in zip(cells.x_names, row, strict=True)]
            for y, row in zip(panel.y_names, cells.values, strict=True)
        ],
        hoverinfo="text",
        colorbar={"thickness": 14, "len": 0.5, "outlinewidth": 0},
    )


def _columns(cells: Heatmap) -> dict[str, object]:
    names = {"tickmode": "array", "tickvals": list(range(len(cells.x_names))), "ticktext": list(cells.x_names)}
    return names | {"tickangle": -90}


def _limit(fig: go.Figure, panel: Panel, limit: ReferenceLine, cell: dict[str, int]) -> None:
    line = {"line_color": "#666666", "line_width": 1, "line_dash": "dot", **cell}
    note = {"annotation_text": limit.text, "annotation_font_size": 13, "annotation_font_color": "#444444"}
    if limit.upright:
        fig.add_vline(x=limit.at, **line)
        # on a logarithmic axis plotly places notes by the exponent
        where = {"x": log10(limit.at) if panel.log_x else limit.at, "y": 1, "yref": "y domain", "xanchor": "left"}
        text = {"text": limit.text, "font": {"size": 13, "color": "#444444"}, "showarrow": False, "yanchor": "top"}
        fig.add_annotation(**where, **text, **cell)
        return
    place = "bottom right" if limit.below else "top right"
    fig.add_hline(y=limit.at, annotation_position=place, **line, **note)


def _log(span: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if span is None else (log10(span[0]), log10(span[1]))
