"""``[[circles]]``: circles and half circles for a circular test (in the manner of ISO 230-4), as written and in SI."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveInt, field_validator

from planner.common.errors import InputError, did_you_mean
from planner.common.schema import PositiveFloat, StrictModel
from planner.common.units import MM, Array, from_deg, from_mm, read_only
from planner.kinematics.bodies import Vector
from planner.runs.run import Mounting

CirclePlane = Literal["XY", "XZ", "YZ"]
CircleDirection = Literal["ccw", "cw"]
OVERSHOOT_FULL, OVERSHOOT_PART = 45.0, 5.0  # [deg] before and after the sweep, where the cell says nothing
NEAR_CIRCLE = 0.05  # of the radius: as far off the circle a sample may lie to count as on it
SHORT_RADIUS = 5.0  # [mm] no bar is that short


class CircleFile(StrictModel):
    """One circle: where it lies, what is measured of it, how fast, in which directions and under which loads."""

    name: str | None = None
    plane: CirclePlane = "XY"
    fixture: str | None = None
    centre_mm: Vector | None = None
    radius_mm: PositiveFloat | None = None
    start_deg: Annotated[float, Field(ge=-720, le=720)] = 0.0
    sweep_deg: Annotated[float, Field(ge=30, le=360)] = 360.0
    overshoot_deg: Annotated[float, Field(ge=0, le=360)] | None = None
    directions: tuple[CircleDirection, ...] = ("ccw", "cw")
    speed_mm_s: Annotated[float, Field(ge=0.5)] | None = None
    orientation: Literal["constant", "follow"] = "constant"
    tool_axis: Vector | None = None
    loads_N: tuple[PositiveFloat, ...] = ()
    repeats: PositiveInt = 1

    @field_validator("radius_mm")
    @classmethod
    def _millimetres(cls, value: float | None) -> float | None:
        if value is not None and value < SHORT_RADIUS:
            raise ValueError("this looks like metres; the radius is in millimetres")
        return value

    @field_validator("directions")
    @classmethod
    def _each_once(cls, value: tuple[CircleDirection, ...]) -> tuple[CircleDirection, ...]:
        if not value or len(set(value)) < len(value):
            raise ValueError('give "ccw", "cw" or both, each once')
        return value


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
        """Of the circle above the fixture, along its normal [m]."""
        return float((self.centre - self.p_BX) @ self.axes[2])

    def polar(self, x: Array) -> tuple[Array, Array]:
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


def read_circles(
    path: Path, files: Sequence[CircleFile], fixtures: dict[str, Array], lengths: tuple[float, float], speed: float
) -> tuple[Circle, ...]:
    """Return the circles of a cell.

    Args:
        path: the cell's file, for messages.
        files: as read.
        fixtures: name → p_BX (3,) [m], in order.
        lengths: shortest and longest bar [m].
        speed: of circles that name none [m/s].

    Raises:
        InputError: a fixture that is not there, a name used twice, a bar that does not reach the plane.
    """
    names = [_circle_name(f, k, files) for k, f in enumerate(files)]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two circles share a name ({', '.join(names)})")
    return tuple(_read_circle(path, n, f, fixtures, lengths, speed) for n, f in zip(names, files, strict=True))


def _circle_name(file: CircleFile, k: int, files: Sequence[CircleFile]) -> str:
    alone = sum(f.plane == file.plane for f in files) == 1
    return file.name or (file.plane if alone else f"{file.plane} {k + 1}")


def _read_circle(
    path: Path, name: str, f: CircleFile, fixtures: dict[str, Array], lengths: tuple[float, float], speed: float
) -> Circle:
    known = list(fixtures)
    fixture = known[0] if f.fixture is None else f.fixture
    if fixture not in fixtures:
        raise InputError(
            f"{path}: circle {name} is about fixture '{fixture}'{did_you_mean(fixture, known)}; there are {known}"
        )
    given = OVERSHOOT_FULL if f.sweep_deg == 360.0 else OVERSHOOT_PART
    axis = None if f.tool_axis is None else np.array(f.tool_axis)
    if axis is not None and np.linalg.norm(axis) < 1e-9:
        raise InputError(f"{path}: circle {name}: 'tool_axis' = {list(f.tool_axis or ())} is no direction")
    circle = Circle(
        name=name,
        plane=f.plane,
        fixture=known.index(fixture),
        p_BC=fixtures[fixture] if f.centre_mm is None else read_only(from_mm(f.centre_mm)),
        radius=0.0 if f.radius_mm is None else f.radius_mm * MM,
        start=float(from_deg(f.start_deg)),
        sweep=float(from_deg(f.sweep_deg)),
        overshoot=float(from_deg(given if f.overshoot_deg is None else f.overshoot_deg)),
        directions=f.directions,
        speed=speed if f.speed_mm_s is None else f.speed_mm_s * MM,
        follows=f.orientation == "follow",
        axis_B=None if axis is None else read_only(axis / np.linalg.norm(axis)),
        loads=f.loads_N,
        repeats=f.repeats,
    )
    return circle if circle.radius else _with_middle_length(path, circle, fixtures[fixture], lengths)


def _with_middle_length(path: Path, circle: Circle, p_BX: Array, lengths: tuple[float, float]) -> Circle:
    """Give the circle the radius at which a bar of its middle length reaches it."""
    middle, height = sum(lengths) / 2, float((circle.p_BC - p_BX) @ circle.normal)
    if not abs(height) < middle < np.inf:
        raise InputError(
            f"{path}: circle {circle.name} lies {abs(height) / MM:.1f} mm beside its fixture's plane, more than the "
            f"bar's middle length of {middle / MM:.1f} mm: give radius_mm, or a centre_mm nearer to the fixture"
        )
    return replace(circle, radius=float(np.sqrt(middle**2 - height**2)))
