"""Draws a chart for the page: plotly figures as JSON, the same bytes every time.

The figures are plain dictionaries in plotly's own terms (plotly.com/javascript/reference): plotly's Python objects
check every property, which takes longer than everything else on the page.
"""

import json
from base64 import b64encode
from math import log10
from typing import Any, NamedTuple

import numpy as np

from planner.report.chart import (
    BLUE,
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

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
INK, GRID_COLOUR = "#222222", "#E4E4E4"
PAGE = {"paper_bgcolor": "white", "font": {"family": FONT, "size": 14, "color": INK}}  # [px] size of letters
PLAIN = {"exponentformat": "none"}  # 0.0006 and not 600µ: the unit stands in the label
LINES = {"showline": True, "linecolor": "#999999", "ticks": "outside", "tickcolor": "#999999", "zeroline": False}
AXIS = LINES | PLAIN


Properties = dict[str, Any]
"""Part of a figure, in plotly's terms."""


def figure_json(data: list[Properties], layout: Properties) -> str:
    """Return a figure as JSON, its arrays packed."""
    return json.dumps({"data": data, "layout": layout}, default=_pack, allow_nan=False)


def _pack(values: object) -> object:
    """Return an array as plotly's page reads it (base64 of its numbers), a number as Python's own."""
    if not isinstance(values, np.ndarray):
        return values.item()  # type: ignore[attr-defined]
    kind = values.dtype.str[1:] if values.dtype.kind == "f" else "i4"
    data = b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes())
    packed = {"dtype": kind, "bdata": data.decode("ascii")}
    return packed if values.ndim == 1 else packed | {"shape": ", ".join(str(n) for n in values.shape)}


def chart_json(chart: Chart) -> str:
    """Return the plotly figure of a chart as JSON."""
    return _polar_figure(chart.panels[0]) if chart.panels[0].rings else _figure(chart)


def _figure(chart: Chart) -> str:
    # part of the width between panels side by side, for each of them: a scale of colours has numbers of its own
    aside = 0.26 if any(p.field for p in chart.panels) else 0.21
    right = 30  # [px] of the margin
    low = 52  # [px] of the margin
    top = 36  # [px] of the margin
    gap = 78  # [px] between two panels, room for a label and the next title
    heights = [max(p.height for p in row) for row in chart.rows]
    inner = sum(heights) + gap * (len(heights) - 1)
    # [px] the margin is 74 wide, or as wide as the longest name at 9 a letter
    left = max([74, *(18 + 9 * len(name) for p in chart.panels for name in p.y_names)])
    layout: Properties = PAGE | {
        "height": inner + top + low,
        "margin": {"l": left, "r": right, "t": top, "b": low},
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": "white", "font": {"family": FONT, "size": 13}},
        "bargap": 0.35,
        "annotations": [],
        "shapes": [],
    }
    data: list[Properties] = []
    named: set[str] = set()
    width = (1 - aside / chart.columns * (chart.columns - 1)) / chart.columns
    for k, panel in enumerate(chart.panels):
        row, column = divmod(k, chart.columns)
        bottom = inner - sum(heights[: row + 1]) - gap * row
        start = column * (width + aside / chart.columns)
        upwards = (bottom / inner, (bottom + heights[row]) / inner)
        place = _Place(str(k + 1) if k else "", (start, start + width), upwards)
        _draw(data, layout, panel, place, named)
    return figure_json(data, layout)


class _Place(NamedTuple):
    """A panel's ``number``, as plotly puts it behind the names of axes, and its part of the figure's width and height,
    from the left and from below."""

    number: str
    across: Span
    upwards: Span


def _polar_figure(panel: Panel) -> str:
    ring, rings = panel.rings, (panel.rings * np.array([-2, 0, 2])).tolist()
    data = []
    for s in panel.series:
        hover = {"hovertext": s.hover, "hoverinfo": "text"} if s.hover else {"hoverinfo": "skip"}
        look = {"type": "scatterpolar", "mode": "lines", "name": s.name, "line": _line(s), **hover}
        data.append({"theta": s.x, "r": s.y, **look})
    radial = {
        "range": [-POLAR_BASE * ring, 3.4 * ring],
        "tickvals": rings,
        "ticktext": [f"{r:+g} {panel.y_label}" if r else "0" for r in rings],
        "gridcolor": GRID_COLOUR,
        "angle": 22.5,
        "tickangle": 0,
        "tickfont": {"size": 11},
    }
    angular = {"gridcolor": "#EEEEEE", "linecolor": "#CCCCCC", "ticksuffix": "°"}
    polar = {"bgcolor": "white", "angularaxis": angular, "radialaxis": radial}
    margin = {"l": 40, "r": 40, "t": 30, "b": 30}
    return figure_json(data, PAGE | {"height": panel.height, "margin": margin, "polar": polar})


def _draw(data: list[Properties], layout: Properties, panel: Panel, place: _Place, named: set[str]) -> None:
    number, (left, right), (_, top) = place
    axes = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
    if panel.title:
        where = {"x": left, "y": top, "xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom"}
        layout["annotations"].append({"text": panel.title, "font": {"size": 15}, "showarrow": False, **where})
    for series in panel.series:
        show = len(panel.series) > 1 and bool(series.name) and series.name not in named
        named.add(series.name)
        data.append(_trace(series, show) | axes | {"legend": f"legend{number}"})
    if panel.cells is not None:
        data.append(_heatmap(panel, panel.cells) | axes)
    if panel.field is not None:
        data.insert(0, _field(panel.field, right, place.upwards) | axes)  # points lie on it
    corner = {"x": right, "xanchor": "right", "y": top, "yanchor": "bottom"}
    layout[f"legend{number}"] = {"orientation": "h", **corner, "itemsizing": "constant"}
    for line in panel.limits:
        _reference_line(layout, panel, line, number)
    layout[f"xaxis{number}"] = _axis_across(panel) | {"anchor": f"y{number}", "domain": place.across}
    layout[f"yaxis{number}"] = _axis_down(panel) | {"anchor": f"x{number}", "domain": place.upwards}


def _axis_across(panel: Panel) -> Properties:
    along = _range(panel.x_range, panel.log_x)
    if panel.cells is not None:
        along |= _names(panel.cells.x_names) | {"tickangle": -90}
    elif panel.log_x:
        along |= _log_axis(panel.log_span("x"))
    title = {"text": panel.x_label, "standoff": 8}
    return AXIS | along | {"title": title, "showgrid": bool(panel.y_names), "gridcolor": GRID_COLOUR}


def _axis_down(panel: Panel) -> Properties:
    down = _range(panel.y_range, panel.log_y)
    if panel.y_names:
        down = {"range": [len(panel.y_names) - 0.4, -0.6], **_names(panel.y_names)}
    if panel.log_y:
        down |= _log_axis(panel.log_span("y"))
    return AXIS | down | {"title": {"text": panel.y_label}, "showgrid": panel.cells is None, "gridcolor": GRID_COLOUR}


def _log_axis(span: Span) -> Properties:
    values, texts = log_ticks(span, "10<sup>{}</sup>")
    return {"type": "log", "tickmode": "array", "tickvals": values, "ticktext": texts}


def _names(names: tuple[str, ...]) -> Properties:
    return {"tickmode": "array", "tickvals": list(range(len(names))), "ticktext": names}


def _range(span: Span | None, logarithmic: bool) -> Properties:
    if span is None:
        return {}
    return {"range": [log10(v) for v in span] if logarithmic else list(span)}


def _trace(series: Series, show: bool) -> Properties:
    common: Properties = {"type": "scatter", "name": series.name, "x": series.x, "y": series.y}
    common |= {"showlegend": show, "legendgroup": series.name}
    if series.hover:
        common |= {"hovertext": series.hover, "hoverinfo": "text"}
    if series.mark == "bars":
        outside = {"text": series.texts, "textposition": "outside", "cliponaxis": False, "hoverinfo": "skip"}
        return common | {"type": "bar", "orientation": "h", "marker": {"color": series.colour}} | outside
    if series.mark == "points":
        faint = {} if series.opacity == 1.0 else {"opacity": series.opacity}
        return common | {"mode": "markers", "marker": {"color": series.colour, "size": series.size} | faint}
    fill = {"fill": "tozeroy", "fillcolor": f"{series.colour}33"} if series.filled else {}
    return common | {"mode": "lines", "line": _line(series)} | fill


def _line(series: Series) -> Properties:
    return {"color": series.colour, "width": series.width, "dash": "dash" if series.dashed else "solid"}


def _heatmap(panel: Panel, cells: Heatmap) -> Properties:
    texts = [
        [f"{y} and {x}: {v:+.2f}" for x, v in zip(cells.x_names, row, strict=True)]
        for y, row in zip(panel.y_names, cells.values, strict=True)
    ]
    look = {"zmin": -1, "zmax": 1, "colorscale": [[0, RED], [0.5, "#FFFFFF"], [1, BLUE]], "xgap": 1, "ygap": 1}
    bar = {"thickness": 14, "len": 0.5, "outlinewidth": 0}
    return {"type": "heatmap", "z": cells.values, "text": texts, "hoverinfo": "text", "colorbar": bar, **look}


def _field(field: ColourField, right: float, upwards: Span) -> Properties:
    """Draw a field whose scale of colours stands at the right of its panel, which ends at ``right``."""
    low, top = upwards
    place = {"len": top - low, "x": right, "xpad": 4, "y": top, "yanchor": "top"}
    bar = {"thickness": 10, "outlinewidth": 0, "tickfont": {"size": 12}, **place, **PLAIN}
    hover = f"%{{x:.0f}}, %{{y:.0f}}: {field.label} %{{z:.3g}}<extra></extra>"
    # plotly.js has this scale from dark red to yellow, all others from yellow to dark red
    colours = {"colorscale": "YlOrRd", "reversescale": True}
    colours |= dict(zip(("zmin", "zmax"), field.span, strict=True))
    look = {"type": "heatmap", **colours, "colorbar": bar, "hovertemplate": hover}
    return {"x": field.x, "y": field.y, "z": field.values.astype(np.float32), **look}


def _reference_line(layout: Properties, panel: Panel, line: ReferenceLine, number: str) -> None:
    look = {"type": "line", "line": {"color": "#666666", "width": 1, "dash": "dot"}}
    note = {"text": line.text, "font": {"size": 13, "color": "#444444"}, "showarrow": False}
    along, over = ("x", "y") if line.upright else ("y", "x")
    span = {f"{along}0": line.at, f"{along}1": line.at, f"{over}0": 0, f"{over}1": 1}
    refs = {f"{along}ref": f"{along}{number}", f"{over}ref": f"{over}{number} domain"}
    layout["shapes"].append(look | span | refs)
    # on a logarithmic axis plotly places notes by the exponent
    at = log10(line.at) if (panel.log_x if line.upright else panel.log_y) else line.at
    sides = ("left", "top") if line.upright else ("right", "top" if line.below else "bottom")
    place = {along: at, over: 1, "xanchor": sides[0], "yanchor": sides[1]}
    layout["annotations"].append(note | place | refs)
