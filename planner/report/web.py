"""Draws a picture for the page: plotly figures as JSON, the same bytes every time."""

from math import log10

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from planner.report.picture import Limit, Panel, Picture, Series

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
INK, RULE = "#222222", "#E4E4E4"
GAP = 78  # [px] between two panels, room for a label and the next title
TOP, BOTTOM, LEFT, RIGHT = 36, 52, 74, 30


def figure_json(picture: Picture) -> str:
    """Return the plotly figure of a picture as JSON."""
    return str(figure(picture).to_json())


def figure(picture: Picture) -> go.Figure:
    """Return the plotly figure of a picture: panels one above the other."""
    heights = [p.height for p in picture.panels]
    inner = sum(heights) + GAP * (len(heights) - 1)
    fig = make_subplots(
        rows=len(heights),
        cols=1,
        row_heights=heights,
        vertical_spacing=GAP / inner,
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
    fig.update_annotations(x=0, xanchor="left", font_size=15)
    named: set[str] = set()
    for row, panel in enumerate(picture.panels, start=1):
        _draw(fig, panel, row, named)
    return fig


def _draw(fig: go.Figure, panel: Panel, row: int, named: set[str]) -> None:
    several = len(panel.series) > 1
    legend = "legend" if row == 1 else f"legend{row}"
    for series in panel.series:
        show = several and bool(series.name) and series.name not in named
        named.add(series.name)
        fig.add_trace(_trace(series, show).update(legend=legend), row=row, col=1)
    top = next(fig.select_yaxes(row=row, col=1)).domain[1]
    place = {"orientation": "h", "x": 1, "xanchor": "right", "y": top, "yanchor": "bottom", "itemsizing": "constant"}
    fig.update_layout({legend: place})
    for limit in panel.limits:
        _limit(fig, panel, limit, row)
    axis = {"showline": True, "linecolor": "#999999", "ticks": "outside", "tickcolor": "#999999", "zeroline": False}
    fig.update_xaxes(
        title_text=panel.x_label,
        title_standoff=8,
        showgrid=bool(panel.y_names),
        gridcolor=RULE,
        range=_log(panel.x_range) if panel.log_x else panel.x_range,
        row=row,
        col=1,
        **({"type": "log", "dtick": 1, "exponentformat": "power"} if panel.log_x else {}),
        **axis,
    )
    names = {"tickmode": "array", "tickvals": list(range(len(panel.y_names))), "ticktext": list(panel.y_names)}
    down = {"range": [len(panel.y_names) - 0.4, -0.6], **names} if panel.y_names else {"range": panel.y_range}
    fig.update_yaxes(title_text=panel.y_label, showgrid=True, gridcolor=RULE, row=row, col=1, **down, **axis)


def _trace(series: Series, show: bool) -> go.Scatter | go.Bar:
    common = {"name": series.name, "x": series.x, "y": series.y, "showlegend": show, "legendgroup": series.name}
    if series.hover:
        common |= {"hovertext": series.hover, "hoverinfo": "text"}
    if series.mark == "bars":
        outside = {"text": series.texts, "textposition": "outside", "cliponaxis": False, "hoverinfo": "skip"}
        return go.Bar(orientation="h", marker={"color": series.colour}, **common, **outside)
    if series.mark == "points":
        return go.Scatter(mode="markers", marker={"color": series.colour, "size": 7}, **common)
    line = {"color": series.colour, "width": series.width, "dash": "dash" if series.dashed else "solid"}
    return go.Scatter(mode="lines", line=line, **common)


def _limit(fig: go.Figure, panel: Panel, limit: Limit, row: int) -> None:
    line = {"line_color": "#666666", "line_width": 1, "line_dash": "dot", "row": row, "col": 1}
    note = {"annotation_text": limit.text, "annotation_font_size": 13, "annotation_font_color": "#444444"}
    if limit.upright:
        fig.add_vline(x=limit.at, **line)
        # on a logarithmic axis plotly places notes by the exponent
        where = {"x": log10(limit.at) if panel.log_x else limit.at, "y": 1, "yref": "y domain", "xanchor": "left"}
        text = {"text": limit.text, "font": {"size": 13, "color": "#444444"}, "showarrow": False, "yanchor": "top"}
        fig.add_annotation(**where, **text, row=row, col=1)
        return
    place = "bottom right" if limit.below else "top right"
    fig.add_hline(y=limit.at, annotation_position=place, **line, **note)


def _log(span: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if span is None else (log10(span[0]), log10(span[1]))
