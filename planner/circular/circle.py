"""Circles and half circles of a cell for a circular test, in the manner of ISO 230-4."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.cell.cell import Cell
from planner.cell.section_content import SectionContent
from planner.common.units import Array
from planner.runs.run import Mounting

CirclePlane = Literal["XY", "XZ", "YZ"]
CircleDirection = Literal["ccw", "cw"]
CIRCLES = "circles"  # the table of a cell file
NEAR_CIRCLE = 0.05  # of the radius: as far off the circle a sample may lie to count as on it


@dataclass(frozen=True)
class Circle:
    """A circle about p_BC in a plane of the base frame.

    Angles count from the plane's first axis towards its second; "ccw" is the way they grow.

    Attributes:
        name: short name; plane: its two axes; fixture: which fixture holds the bar.
        p_BC: centre (3,) [m]; radius [m].
        start, sweep: of what is measured; overshoot: driven before and after it [rad].
        directions: in which it is driven, in that order, ``repeats`` times for each load.
        speed: of the tool point [m/s].
        follows: whether the tool turns with the bar; else it keeps its orientation.
        axis_B: direction of the tool's ball-joint axis at the start (3,), ``None`` to have one chosen.
        loads: forces along the bar [N], empty for an unloaded bar.
    """

    name: str
    plane: CirclePlane
    fixture: int
    p_BC: Array
    radius: float
    start: float
    sweep: float
    overshoot: float
    directions: tuple[CircleDirection, ...]
    speed: float
    follows: bool
    axis_B: Array | None
    loads: tuple[float, ...]
    repeats: int

    @property
    def mounting(self) -> Mounting:
        """The bar is held at the circle's fixture and the tool's first point."""
        return Mounting(self.fixture)

    @property
    def axes(self) -> tuple[Array, Array]:
        """The plane's first and second axis in the base frame, (3,) each."""
        first, second = ("XYZ".index(a) for a in self.plane)
        return np.eye(3)[first], np.eye(3)[second]

    @property
    def normal(self) -> Array:
        """The axis about which angles grow, (3,)."""
        return np.cross(*self.axes)

    def points(self, angle: Array) -> Array:
        """Points p_BM (n, 3) [m] at angles (n,) [rad]."""
        first, second = self.axes
        return np.asarray(self.p_BC + self.radius * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second))


@dataclass(frozen=True)
class Circles(SectionContent):
    """``[[circles]]`` of a cell, as read."""

    circles: tuple[Circle, ...]
    replaces_poses = True

    @property
    def pulls(self) -> dict[int, str]:
        """The fixtures of circles that are driven under load."""
        return {c.fixture: f"{CIRCLES}.loads_N" for c in self.circles if c.loads}


def circles_of(cell: Cell) -> tuple[Circle, ...]:
    """Return the circles of a cell, in the order of its file."""
    content = cell.sections.get(CIRCLES)
    return content.circles if isinstance(content, Circles) else ()


def replace_circles(cell: Cell, *circles: Circle) -> Cell:
    """Return a cell with other circles, or with none."""
    others = {key: content for key, content in cell.sections.items() if key != CIRCLES}
    return replace(cell, sections=others | ({CIRCLES: Circles(circles)} if circles else {}))


@dataclass(frozen=True)
class CircleAtFixture:
    """A circle, in the base frame, and the ball at the fixed end of the bar.

    Attributes:
        centre: (3,) [m].
        axes: rows are the directions of angle 0 and 90 degrees and the normal, (3, 3).
        radius: [m].
        p_BX: the fixture's ball (3,) [m].
    """

    centre: Array
    axes: Array
    radius: float
    p_BX: Array

    @property
    def height(self) -> float:
        """Height of the circle above the fixture, along its normal [m]."""
        return float((self.centre - self.p_BX) @ self.axes[2])

    def to_polar(self, x: Array) -> tuple[Array, Array]:
        """Angle (n,) [rad] of points x (n, 3) [m], and how far they lie off the circle, (n,) [m]."""
        u, v, height = self.axes @ (x - self.centre).T
        return np.arctan2(v, u), np.asarray(np.hypot(np.hypot(u, v) - self.radius, height))

    def in_plane(self, angle: Array, length: Array) -> Array:
        """Points (n, 2) [m] from the centre, where a bar of this length (n,) [m] ends at angles (n,) [rad]."""
        unit = np.column_stack([np.cos(angle), np.sin(angle)])
        foot = self.axes[:2] @ (self.p_BX - self.centre)
        away = self.radius * unit - foot
        reach = np.sqrt(np.maximum(length**2 - self.height**2, 0.0))
        return np.asarray(foot + away * (reach / np.linalg.norm(away, axis=1))[:, None])
