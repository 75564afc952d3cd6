"""A picture as data: what is drawn, without a word on how; the page and the prints draw the same one."""

from dataclasses import dataclass
from typing import Literal

from planner.common.units import Array

BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#222222", "#8A8A8A"
JOINTS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BLACK)
"""Okabe and Ito's palette: told apart by every common kind of colour vision."""
ROLES = {"calibrate": BLUE, "repeat": PURPLE, "validate": ORANGE, "mount": BLACK}


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
        x_names: one a column; the panel's ``y_names`` are one a row.
    """

    values: Array
    x_names: tuple[str, ...]


@dataclass(frozen=True)
class ReferenceLine:
    """A straight line across the panel, and what it stands for."""

    at: float
    text: str
    upright: bool = False
    below: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes; ``y_names`` names the places 0, 1, … from the top down."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    limits: tuple[ReferenceLine, ...] = ()
    log_x: bool = False
    log_y: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    y_names: tuple[str, ...] = ()
    height: int = 250
    cells: Heatmap | None = None


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
