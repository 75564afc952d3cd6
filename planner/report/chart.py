"""A chart as data: what is drawn, not how; the page (SVG) and the pictures (matplotlib) draw the same one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from planner.common.units import Array

BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#222222", "#8A8A8A"
JOINTS = (BLUE, ORANGE, GREEN, RED, PURPLE, BLACK, SKY)  # six joints without a second blue
"""Okabe and Ito's palette: told apart by every common kind of colour vision."""
FIELD_SCALE = ("#FFFFCC", "#FFE692", "#FEBF5A", "#FD8C3C", "#F43D25", "#C90823", "#800026")
"""From small to large: ColorBrewer's YlOrRd, on the page and in print."""
Span = tuple[float, float]
ROLES = {"calibrate": BLUE, "repeat": GREEN, "validate": PURPLE, "mount": ORANGE}  # as in view3d.js


def hex_colour(name: str) -> Array:
    """Return red, green and blue of ``#RRGGBB``, (3,) 0 … 255."""
    return np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)], dtype=float)


@dataclass(frozen=True)
class Series:
    """One line, set of points, or set of horizontal bars.

    Attributes:
        name: for the legend.
        x, y: (n,) in the units of the panel's labels.
        mark: how it is drawn.
        hover: one text a point, shown under the pointer.
        texts: one text a point, written beside it.
        size: diameter of a point [px]; opacity: 0 … 1.
        filled: whether the area below a line is tinted.
    """

    name: str
    x: Array
    y: Array
    colour: str
    mark: Literal["line", "points", "bars"] = "line"
    dashed: bool = False
    width: float = 1.5
    hover: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    size: float = 7.0
    opacity: float = 1.0
    filled: bool = False


@dataclass(frozen=True)
class Heatmap:
    """A field of coloured squares from −1 (orange) over 0 (white) to 1 (blue).

    Attributes:
        values: (rows, columns), the first row on top.
        x_names: names of the columns; those of the rows are the panel's ``y_names``.
    """

    values: Array
    x_names: tuple[str, ...]


@dataclass(frozen=True)
class ColourField:
    """A quantity over a plane in colours, from pale (small) to dark (large).

    Attributes:
        x, y: middles of the squares, (c,) and (r,), evenly apart.
        values: (r, c), not a number where nothing is known.
        label: what the colours stand for, with its unit in brackets.
        most: value of the darkest colour, the palest being zero; else both are those of the values.
    """

    x: Array
    y: Array
    values: Array
    label: str
    most: float | None = None

    @property
    def span(self) -> Span:
        """Values of the palest and the darkest colour, both ticks; a fifth apart, so an even field looks even."""
        if self.most is not None:
            low, high = 0.0, self.most or 1.0
        else:
            low, high = float(np.nanmin(self.values)), float(np.nanmax(self.values))
            spare = max(0.0, 0.1 * (abs(low) + abs(high)) - (high - low)) / 2  # a tenth of the mean on either side
            low, high = low - spare, high + (spare or float(low == high))
        step = _tick_step((low, high))
        return float(step * np.floor(low / step + 1e-9)), float(step * np.ceil(high / step - 1e-9))

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return self.label.partition("(")[2].removesuffix(")")

    @property
    def ticks(self) -> tuple[list[float], list[str]]:
        """Values at the scale of the colours, its ends among them, and their texts."""
        return linear_ticks(self.span)


@dataclass(frozen=True)
class ReferenceLine:
    """A straight line across the panel, and what it stands for."""

    at: float
    text: str
    upright: bool = False
    below: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes; ``y_names`` names the places 0, 1, … from the top down.

    With ``rings`` the axes are polar: x is an angle [deg], y a deviation from the circle y = 0, which is drawn
    ``POLAR_BASE`` rings from the middle; ``rings`` is the deviation from one ring to the next, three of them hold all
    of it.
    """

    title: str = ""
    x_label: str = ""
    y_label: str = ""
    series: tuple[Series, ...] = ()
    limits: tuple[ReferenceLine, ...] = ()
    log_x: bool = False
    log_y: bool = False
    x_range: Span | None = None
    y_range: Span | None = None
    y_names: tuple[str, ...] = ()
    height: int = 250
    cells: Heatmap | None = None
    field: ColourField | None = None
    rings: float = 0.0

    def log_span(self, axis: Literal["x", "y"]) -> Span:
        """Range of a logarithmic axis: as given, else that of all positive values."""
        given = self.x_range if axis == "x" else self.y_range
        values = np.concatenate([np.ravel(getattr(s, axis)) for s in self.series]) if self.series else np.ones(1)
        above = values[values > 0] if (values > 0).any() else np.ones(1)
        return given or (float(above.min()), float(above.max()))


@dataclass(frozen=True)
class Chart:
    """Panels in rows, row by row.

    Attributes:
        name: stem of the file, and name of the place in the page.
        title: what it shows, in a few words.
        caption: what to look at.
        panels: from the top left.
        columns: how many stand side by side.
    """

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1

    @property
    def rows(self) -> tuple[tuple[Panel, ...], ...]:
        """Panels side by side, row by row."""
        return tuple(self.panels[k : k + self.columns] for k in range(0, len(self.panels), self.columns))


def list_panel(
    title: str, label: str, names: Sequence[str], series: Sequence[Series], row: float = 26, rest: int = 20, **axes: Any
) -> Panel:
    """Axes with one name a row from the top down; a row is ``row`` [px] high, ``rest`` [px] stay for the axis."""
    return Panel(title, label, "", tuple(series), y_names=tuple(names), height=int(row * len(names)) + rest, **axes)


def share_panel(
    title: str, label: str, names: Sequence[str], share: Array, hover: list[str], colour: str, span: Span, row: float
) -> Panel:
    """Draw standard deviations over the prior sigma, one parameter a row; at 1, marked by a line, nothing is learnt."""
    points = Series("", share, np.arange(len(names), dtype=float), colour, "points", hover=tuple(hover))
    prior = (ReferenceLine(1.0, "prior sigma", upright=True),)
    return list_panel(title, label, names, [points], row, 30, limits=prior, log_x=True, x_range=span)


def zero_line(x: Array) -> Series:
    """A dashed line at zero, over all x."""
    return Series("", np.array([x.min(), x.max()]), np.zeros(2), GREY, dashed=True, width=1.0)


POLAR_BASE = 9.0  # rings of a polar panel from its middle to the circle that deviations count from


def log_ticks(span: Span, power: str) -> tuple[list[float], list[str]]:
    """Return where a logarithmic axis has ticks, and their texts: powers of ten; finer ones where those are too few.

    ``power`` is how an exponent is written, such as ``10<sup>{}</sup>``.
    """
    low, high = span
    first, last = int(np.floor(np.log10(low))) - 1, int(np.ceil(np.log10(high))) + 1
    decades = float(np.log10(high / low)) or 2.0  # about a single value both drawings leave a decade
    if decades >= 2.0:  # two powers of ten at least are in it
        powers = range(first, last + 1)
        # four decades about 1 are written without powers
        plain = [f"{10.0**k:.{max(-k, 0)}f}" if abs(k) <= 4 else power.format(k) for k in powers]
        return [10.0**k for k in powers], plain
    if decades >= 0.6:  # from a to 4 a: three of these at least
        each = [(m * 10.0**k, max(-k, 0)) for k in range(first, last + 1) for m in (1, 2, 5)]
        return [v for v, _ in each], [f"{v:.{places}f}" for v, places in each]
    rough = max(high - low, 1e-6 * high) / 5  # five steps at most
    ten = int(np.floor(np.log10(rough)))
    step = next(m for m in (1, 2, 5, 10) if m * 10.0**ten >= rough) * 10.0**ten
    values = [k * step for k in range(max(1, int(low / step) - 1), int(high / step) + 2)]
    return values, [f"{v:.{max(-ten, 0)}f}" for v in values]


def _tick_step(span: Span, most: int = 8) -> float:
    """Return how far the ticks of an even axis are apart: 1, 2 or 5 times a power of ten."""
    rough = max(span[1] - span[0], 1e-300) / max(most, 1)
    ten = int(np.floor(np.log10(rough)))
    step = float(next(m for m in (1, 2, 5, 10) if m * 10.0**ten >= rough * (1 - 1e-9)) * 10.0**ten)
    if np.floor(span[1] / step + 1e-9) - np.ceil(span[0] / step - 1e-9) < 1:  # one number gives no scale
        step /= 5.0 if round(step / 10.0**ten) == 5 else 2.0
    return step


def linear_ticks(span: Span, most: int = 8) -> tuple[list[float], list[str]]:
    """Return where an even axis has ticks, at most about so many, and their texts."""
    (low, high), step = span, _tick_step(span, most)
    places = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    values = [k * step for k in range(int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9)) + 1)]
    return values, [f"{v + 0.0:.{places}f}" for v in values]


def joint_series(x: Array, values: Array, width: float = 1.5) -> tuple[Series, ...]:
    """One line a joint, values (n, N)."""
    return tuple(Series(f"joint {j + 1}", x, v, JOINTS[j % len(JOINTS)], width=width) for j, v in enumerate(values.T))


def histogram_outline(edges: Array, counts: Array) -> tuple[Array, Array]:
    """Outline of a histogram with these edges of its bars, to be filled."""
    return np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(counts, 2), [0.0]])


def golden_steps(n: int) -> Array:
    """Offsets −½ … ½ (n,) that put points side by side which would lie on each other."""
    return np.asarray(np.arange(n) * 0.6180339887 % 1 - 0.5)  # the golden ratio less one


def weighted_means(x: Array, y: Array, weight: Array | None = None, most: int = 24) -> tuple[Array, Array]:
    """Means of y by weight in groups of equal count along x; a quantity with few values has one group a value."""
    weight = np.ones(len(x)) if weight is None else weight
    values, group = np.unique(x, return_inverse=True)
    if len(values) > most:
        group = np.empty(len(x), dtype=int)
        group[np.argsort(x, kind="stable")] = np.arange(len(x)) * most // len(x)
    total = np.bincount(group, weight)
    kept = total > 0
    middle = np.bincount(group, x) / np.maximum(np.bincount(group), 1)
    return middle[kept], np.bincount(group, weight * y)[kept] / total[kept]
