"""``[[circles]]`` of a cell file: as it is written, and how it is read."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveInt, field_validator

from planner.cell.file import CellFile
from planner.cell.places import unit_vector
from planner.cell.reading import SectionReader, gauge_class
from planner.circular.plan import Circle, CircleDirection, CirclePlane, Circles
from planner.common.errors import InputError, did_you_mean
from planner.common.schema import PositiveFloat, StrictModel
from planner.common.units import MM, MM_PER_MIN, from_deg, from_mm, read_only
from planner.kinematics.bodies import Vector


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
        if value is not None and value < 5.0:  # [mm] no bar is that short
            raise ValueError("this looks like metres; the radius is in millimetres")
        return value

    @field_validator("directions")
    @classmethod
    def _each_once(cls, value: tuple[CircleDirection, ...]) -> tuple[CircleDirection, ...]:
        if not value or len(set(value)) < len(value):
            raise ValueError('give "ccw", "cw" or both, each once')
        return value


def read_circles(path: Path, file: CellFile, rows: Sequence[CircleFile]) -> Circles:
    """Return the circles; one without a radius gets that at which a bar of its middle length reaches it."""
    if not file.fixtures or file.gauge.length_mm is None:
        raise InputError(f"{path}: [[circles]] need a [[fixtures]] table and 'gauge.length_mm'")
    if any(c.loads_N for c in rows) and not gauge_class(file).is_loaded:
        raise InputError(f"{path}: 'circles.loads_N' needs gauge.kind = 'ldbb', found '{file.gauge.kind}'")
    names = [_circle_name(c, k, rows) for k, c in enumerate(rows)]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two circles share a name ({', '.join(names)})")
    middle = sum(length * MM for length in file.gauge.length_mm) / 2
    circles = [(_read_circle(path, n, c, file), c) for n, c in zip(names, rows, strict=True)]
    return Circles(tuple(c if f.radius_mm else _with_middle_length(path, c, file, middle) for c, f in circles))


def _circle_name(circle: CircleFile, k: int, files: Sequence[CircleFile]) -> str:
    alone = sum(f.plane == circle.plane for f in files) == 1
    return circle.name or (circle.plane if alone else f"{circle.plane} {k + 1}")


def _read_circle(path: Path, name: str, f: CircleFile, file: CellFile) -> Circle:
    known = [x.name for x in file.fixtures]
    fixture = known[0] if f.fixture is None else f.fixture
    if fixture not in known:
        raise InputError(
            f"{path}: circle {name} is about fixture '{fixture}'{did_you_mean(fixture, known)}; there are {known}"
        )
    # 5.0: [deg] before and after the sweep, where the cell says nothing
    at, given = known.index(fixture), 45.0 if f.sweep_deg == 360.0 else 5.0
    return Circle(
        name=name,
        plane=f.plane,
        fixture=at,
        p_BC=read_only(from_mm(f.centre_mm or file.fixtures[at].position_mm)),
        radius=(f.radius_mm or 0.0) * MM,
        start=float(from_deg(f.start_deg)),
        sweep=float(from_deg(f.sweep_deg)),
        overshoot=float(from_deg(given if f.overshoot_deg is None else f.overshoot_deg)),
        directions=f.directions,
        speed=file.motion.tool_speed_mm_min * MM_PER_MIN if f.speed_mm_s is None else f.speed_mm_s * MM,
        follows=f.orientation == "follow",
        axis_B=None if f.tool_axis is None else unit_vector(f"{path}: circle {name}", "tool_axis", f.tool_axis),
        loads=f.loads_N,
        repeats=f.repeats,
    )


def _with_middle_length(path: Path, circle: Circle, file: CellFile, middle: float) -> Circle:
    """Give the circle the radius at which a bar of its middle length [m] reaches it."""
    height = float((circle.p_BC - from_mm(file.fixtures[circle.fixture].position_mm)) @ circle.normal)
    if not abs(height) < middle:
        raise InputError(
            f"{path}: circle {circle.name} lies {abs(height) / MM:.1f} mm beside its fixture's plane, more than the "
            f"bar's middle length of {middle / MM:.1f} mm: give radius_mm, or a centre_mm nearer to the fixture"
        )
    return replace(circle, radius=float(np.sqrt(middle**2 - height**2)))


READER = SectionReader(CircleFile, read_circles)
