"""Draws a chart for the page as plain HTML and SVG, without a script: the same bytes every time.

Lines and points stand in a square of ``GRID`` by ``GRID`` units that the browser stretches to the room there is. Texts
stand around it as HTML, so that letters keep their size on a phone, on a desk and in print.
"""

import re
from base64 import b64encode
from html import escape
from io import BytesIO
from typing import NamedTuple

import numpy as np
from PIL import Image

from planner.common.units import Array
from planner.report.chart import (
    BLUE,
    FIELD_SCALE,
    POLAR_BASE,
    RED,
    Chart,
    ColourField,
    Panel,
    ReferenceLine,
    Series,
    Span,
    hex_colour,
    linear_ticks,
    log_ticks,
)

GRID = 2000  # units of a panel in either direction: finer than the dots of a screen
MIDDLE = 300  # units of a polar panel from its edge to its middle


def chart_html(chart: Chart) -> str:
    """Return the panels of a chart."""
    named: set[str] = set()
    panels = "".join(_polar(p) if p.rings else _panel(p, named) for p in chart.panels)
    return f'<div class="panels columns{min(chart.columns, len(chart.panels))}">{panels}</div>'


class _Axis(NamedTuple):
    """How values of one axis become units of the grid: linear, or by logarithms, upwards or from the top down."""

    span: Span
    log: bool
    down: bool

    def place(self, values: Array) -> Array:
        """Units of the grid, from the left or from the top, (n,)."""
        low, high = np.log10(self.span) if self.log else self.span
        if self.log:
            with np.errstate(divide="ignore"):
                values = np.log10(np.maximum(values, 1e-300))
        share = (np.asarray(values, float) - low) / (high - low or 1.0)
        return np.asarray(GRID * (1.0 - share if self.down else share))

    def percent(self, value: float) -> float:
        """Place of one value, in percent of the panel's width or height."""
        return round(float(self.place(np.array([value]))[0]) * 100 / GRID, 2)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Values at the axis, with their percentages and texts."""
        values, texts = log_ticks(self.span, "10<sup>{}</sup>") if self.log else linear_ticks(self.span, most)
        at = [(self.percent(v), t) for v, t in zip(values, texts, strict=True)]
        return [(p, t) for p, t in at if -0.01 <= p <= 100.01]


def _axes(panel: Panel) -> tuple[_Axis, _Axis]:
    x_span = panel.log_span("x") if panel.log_x else panel.x_range or _seen_span(panel, "x")
    if panel.y_names:
        # a row, or half of one, above the first name: what is written at an upright line stands there
        top = -1.2 if any(line.upright and line.text for line in panel.limits) else -0.6
        return _Axis(x_span, panel.log_x, False), _Axis((top, len(panel.y_names) - 0.4), False, False)
    y_span = panel.log_span("y") if panel.log_y else panel.y_range or _seen_span(panel, "y")
    return _Axis(x_span, panel.log_x, False), _Axis(y_span, panel.log_y, True)


def _seen_span(panel: Panel, axis: str) -> Span:
    """Range of all values, with room at either end."""
    values = [np.ravel(getattr(s, axis)) for s in panel.series]
    if panel.field is not None:
        values.append(getattr(panel.field, axis))
    if panel.cells is not None:
        values.append(np.array([-0.5, len(panel.cells.x_names) - 0.5]))
    seen = np.concatenate([*values, [line.at for line in panel.limits if line.upright == (axis == "x")]])
    seen = seen[np.isfinite(seen)]
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (0.0, 1.0)
    pad = 0.0 if panel.cells is not None else 0.04 * (high - low) or 0.5  # part of the range
    return low - pad, high + pad


def _panel(panel: Panel, named: set[str]) -> str:
    x, y = _axes(panel)
    inside = "".join(_series(s, x, y) for s in panel.series)
    under = _grid(panel, x, y) + "".join(_reference_line(line, x, y) for line in panel.limits)
    picture = _picture(panel, x, y)
    texts = "".join(_bar_texts(s, x, y) for s in panel.series) + "".join(_note(line, x, y) for line in panel.limits)
    wide = max((len(n) for n in panel.y_names), default=0)
    up = 0.2 if any(s.texts for s in panel.series) else 0.0  # of a row: the middle of a bar that has its text below
    names = [(y.percent(k - up), name) for k, name in enumerate(panel.y_names)]
    down = [(p, escape(t)) for p, t in names] or y.ticks(max(3, panel.height // 55))  # [px] a tick
    # 4: the label, and gaps
    letters_down = min(wide, 34) + 2 if wide else 4 + max((_count_letters(t) for _, t in down), default=0)
    style = f' style="--names:{letters_down}ch"'
    across = (
        [(x.percent(float(k)), escape(n)) for k, n in enumerate(panel.cells.x_names)] if panel.cells else x.ticks(5)
    )
    svg = (
        f'<svg viewBox="0 0 {GRID} {GRID}" preserveAspectRatio="none" aria-hidden="true">{picture}{under}{inside}</svg>'
    )
    marks = "".join(f'<span class="tick" style="top:{p}%">{t}</span>' for p, t in down)
    # letters for which a phone has room below a panel, two of them between numbers
    room, letters = (24 if wide else 38), sum(_count_letters(t) + 2 for _, t in across)
    step = 1 if panel.cells else -(-letters // room)
    # 97: [%] of the width, from which half of a number would stand outside
    feet = "".join(
        f'<span class="tick{" end" if p > 97 else ""}{" spare" if k % step else ""}" style="left:{p}%">{t}</span>'
        for k, (p, t) in enumerate(across)
    )
    slanted = " slanted" if panel.cells else ""
    return (
        f'<div class="panel"{style}>{_head(panel, named)}<div class="plot">'
        f'<div class="down">{f"<b>{escape(panel.y_label)}</b>" if panel.y_label else ""}{marks}</div>'
        f'<div class="square" style="height:{panel.height}px">{svg}{texts}</div>{_scale(panel)}'
        f'<div class="across{slanted}">{feet}</div>'
        f'<div class="label">{escape(panel.x_label)}</div></div></div>'
    )


def _count_letters(html: str) -> int:
    return len(re.sub("<.*?>", "", html))


def _head(panel: Panel, named: set[str]) -> str:
    """Title, and legend of what no panel before has ``named``."""
    new = {s.name: s for s in panel.series if s.name and s.name not in named} if len(panel.series) > 1 else {}
    named |= new.keys()
    keys = "".join(
        f'<span class="key"><i class="{s.mark}{" dashed" if s.dashed else ""}" style="--c:{s.colour}"></i>'
        f"{escape(name)}</span>"
        for name, s in new.items()
    )
    title = f"<b>{escape(panel.title)}</b>" if panel.title else ""
    return f'<div class="head">{title}<span class="keys">{keys}</span></div>' if title or keys else ""


def _grid(panel: Panel, x: _Axis, y: _Axis) -> str:
    if panel.cells is not None or panel.field is not None:
        return ""
    across = panel.y_names
    ticks = x.ticks(5) if across else y.ticks(max(3, panel.height // 55))
    at = [round(p * GRID / 100) for p, _ in ticks]
    lines = "".join(f"M{a} 0V{GRID}" if across else f"M0 {a}H{GRID}" for a in at)
    return f'<path class="grid" d="{lines}"/>'


def _series(s: Series, x: _Axis, y: _Axis) -> str:
    if s.mark == "bars":
        return _bars(s, x, y)
    places = np.stack([x.place(s.x), y.place(s.y)], axis=1)
    known = np.isfinite(places).all(axis=1)
    at = np.rint(places[known].clip(-GRID, 2 * GRID)).astype(int)
    if not len(at):
        return ""
    if s.mark == "points":
        look = f'class="dots" stroke="{s.colour}" stroke-width="{s.size:g}"'
        look += "" if s.opacity == 1.0 else f' opacity="{s.opacity:g}"'
        if s.hover and len(at) <= 400:  # points up to which each has its text under the pointer
            each = (
                f'<path d="M{a} {b}h0"><title>{escape(s.hover[k])}</title></path>'
                for (a, b), k in zip(at, np.flatnonzero(known), strict=True)
            )
            return f'<g class="series" fill="none"><g {look}>{"".join(each)}</g></g>'
        return f'<path {look} d="{_dots(at)}"/>'
    gap = np.append(True, np.diff(np.flatnonzero(known)) > 1)  # a line begins anew behind what is not known
    moved = np.append(True, (np.diff(at, axis=0) != 0).any(axis=1)) | gap
    kept, begins = at[moved], gap[moved]
    way = "".join(f"{'M' if new else 'L'}{a} {b}" for (a, b), new in zip(kept, begins, strict=True))
    dash = ' stroke-dasharray="6 4"' if s.dashed else ""
    area = f'<path d="{way}V{GRID}H{kept[0, 0]}Z" fill="{s.colour}" opacity="0.18"/>' if s.filled else ""
    faint = "" if s.opacity == 1.0 else f' opacity="{s.opacity:g}"'
    return f'{area}<path class="line" d="{way}" stroke="{s.colour}" stroke-width="{s.width:g}"{dash}{faint}/>'


def _dots(at: Array) -> str:
    """Points of no length with round ends, each once."""
    return "".join(f"M{a} {b}h0" for a, b in dict.fromkeys(map(tuple, at.tolist())))


def _bars(s: Series, x: _Axis, y: _Axis) -> str:
    left = max(float(x.place(np.array([x.span[0]]))[0]), 0.0)
    row = GRID / (y.span[1] - y.span[0])
    above, below = (0.4 * row, 0.0) if s.texts else (0.3 * row, 0.3 * row)  # of its middle; texts stand under a bar
    ends, rows = x.place(s.x), y.place(s.y)
    way = "".join(
        f"M{left:.0f} {r - above:.0f}H{e:.0f}V{r + below:.0f}H{left:.0f}Z" for e, r in zip(ends, rows, strict=True)
    )
    return f'<path class="bars" d="{way}" fill="{s.colour}"/>'


def _bar_texts(s: Series, x: _Axis, y: _Axis) -> str:
    places = ((min(x.percent(float(a)), 100.0), y.percent(float(b))) for a, b in zip(s.x, s.y, strict=True))
    each = zip(places, s.texts, strict=False)
    return "".join(f'<span class="beside" style="left:{a}%;top:{b}%">{escape(t)}</span>' for (a, b), t in each)


def _reference_line(line: ReferenceLine, x: _Axis, y: _Axis) -> str:
    at = round((x if line.upright else y).percent(line.at) * GRID / 100)
    return f'<path class="limit" d="{f"M{at} 0V{GRID}" if line.upright else f"M0 {at}H{GRID}"}"/>'


def _note(line: ReferenceLine, x: _Axis, y: _Axis) -> str:
    at = (x if line.upright else y).percent(line.at)
    if not line.text or not 0 <= at <= 100:
        return ""
    where = f"left:{at}%" if line.upright else f"top:{at}%"
    kind = f"upright{' left' if at > 60 else ''}" if line.upright else f"level{' under' if line.below else ''}"
    return f'<span class="note {kind}" style="{where}">{escape(line.text)}</span>'


def _picture(panel: Panel, x: _Axis, y: _Axis) -> str:
    """Squares in colours as one small picture."""
    if panel.field is not None:
        f = panel.field
        half = [0.5 * float(v[1] - v[0]) if len(v) > 1 else 0.5 for v in (f.x, f.y)]
        ends = np.array([f.x[0] - half[0], f.x[-1] + half[0]]), np.array([f.y[-1] + half[1], f.y[0] - half[1]])
        pixels = field_pixels(f)[::-1]
    elif panel.cells is not None:
        n, m = panel.cells.values.shape
        ends, pixels = (np.array([-0.5, m - 0.5]), np.array([-0.5, n - 0.5])), _signed_pixels(panel.cells.values)
    else:
        return ""
    (x0, x1), (y0, y1) = x.place(ends[0]), y.place(ends[1])
    return (
        f'<image x="{x0:.0f}" y="{y0:.0f}" width="{x1 - x0:.0f}" height="{y1 - y0:.0f}" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{png_base64(pixels)}"/>'
    )


def _colours(share: Array, scale: tuple[str, ...]) -> Array:
    """Colours (…, 3) at shares 0 … 1 of a scale of evenly spaced ones."""
    stops = np.array([hex_colour(c) for c in scale])
    at = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(share, at, stops[:, k]) for k in range(3)], axis=-1)


def field_pixels(field: ColourField) -> Array:
    """Pixels (r, c, 4) of a field, clear where nothing is known."""
    low, high = field.span
    known = np.isfinite(field.values)
    share = np.clip((np.where(known, field.values, low) - low) / (high - low or 1.0), 0.0, 1.0)
    return np.concatenate([_colours(share, FIELD_SCALE), 255.0 * known[..., None]], axis=-1).round().astype(np.uint8)


def _signed_pixels(values: Array) -> Array:
    colours = _colours(0.5 + 0.5 * np.clip(values, -1.0, 1.0), (RED, "#FFFFFF", BLUE))
    return np.concatenate([colours, np.full((*values.shape, 1), 255.0)], axis=-1).round().astype(np.uint8)


def png_base64(pixels: np.ndarray) -> str:
    """Return a picture (rows, columns, 3 or 4) as PNG in base64."""
    out = BytesIO()
    Image.fromarray(pixels).save(out, "PNG", optimize=False)
    return b64encode(out.getvalue()).decode("ascii")


def _scale(panel: Panel) -> str:
    """The colours of a field, or of correlations, with their ends."""
    if panel.field is not None:
        colours: tuple[str, ...] = FIELD_SCALE
        texts = panel.field.ticks[1]
        texts[-1] += f"\u00a0{panel.field.unit}"
    elif panel.cells is not None:
        colours, texts = (RED, "#FFFFFF", BLUE), ["−1", "1"]
    else:
        return ""
    return (
        f'<div class="scale"><span>{texts[-1]}</span><i style="background:linear-gradient(0deg,{",".join(colours)})">'
        f"</i><span>{texts[0]}</span></div>"
    )


def _polar(panel: Panel) -> str:
    """Deviations from a circle, ``POLAR_BASE`` rings from the middle."""
    step = MIDDLE / (POLAR_BASE + 4.0)  # of a ring, with room for what is written outside
    rings = "".join(_ring(step * (POLAR_BASE + k), k * panel.rings, panel.y_label) for k in (-2, 0, 2))
    spokes = "".join(_spoke(step * (POLAR_BASE + 3.4), angle) for angle in range(0, 360, 45))
    lines = "".join(_way_around(s, step * (POLAR_BASE + s.y / panel.rings)) for s in panel.series)
    return (
        f'<div class="panel polar">{_head(panel, set())}'
        f'<svg viewBox="0 0 {2 * MIDDLE} {2 * MIDDLE}" aria-hidden="true">'
        f'<g class="rings">{rings}{spokes}</g>{lines}</svg></div>'
    )


def _ring(radius: float, value: float, unit: str) -> str:
    text = f"{value:+g} {escape(unit)}" if value else "0"
    return (
        f'<circle cx="{MIDDLE}" cy="{MIDDLE}" r="{radius:.1f}"/>'
        f'<text x="{MIDDLE + 4}" y="{MIDDLE - radius - 3:.1f}">{text}</text>'
    )


def _spoke(length: float, angle: int) -> str:
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    x, y = MIDDLE + (length + 14) * c, MIDDLE - (length + 14) * s + 4
    way = f"M{MIDDLE} {MIDDLE}L{MIDDLE + length * c:.1f} {MIDDLE - length * s:.1f}"
    return f'<path d="{way}"/><text x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{angle}°</text>'


def _way_around(s: Series, r: Array) -> str:
    a = np.deg2rad(s.x)
    x, y = MIDDLE + r * np.cos(a), MIDDLE - r * np.sin(a)
    way = " ".join(f"{u:.1f} {v:.1f}" for u, v in zip(x, y, strict=True))
    dash = ' stroke-dasharray="6 4"' if s.dashed else ""
    return f'<path class="line" d="M{way}" stroke="{s.colour}" stroke-width="{s.width:g}"{dash}/>'
