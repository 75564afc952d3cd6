"""How the axes of a controller count: from the model's joint angles q to the angles c that the controller shows.

``c = M q + z``: each axis has a sense and a zero of its own, and on some arms an axis counts with another one (J3 of
FANUC with J2, arms with a parallelogram). What leaves the planner for a controller, and what comes back from one,
passes here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from planner.common.errors import InputError
from planner.common.schema import Coordinate, OneLine, PositiveFloat, StrictModel
from planner.common.units import Array, from_deg, from_mm, read_only, to_deg

BORDER_DECIMALS = 9  # of a degree kept at the border: sums of decimals as people write them have no more digits
STROKE_ROUNDING = 1e-6  # [rad] by which an angle may stand over the end of a stroke
MOST_ZERO_DEG = 720.0  # [deg] a zero that is farther off is no zero of an axis: strokes of wrists end there
MOST_FACTOR = 10.0  # by which an axis counts with another one: real ones are 1, or a ratio of gears at a wrist
TO_FILL_IN = re.compile(r"<[^<>]*>")  # what the lines that are advised leave to be filled in
MODEL = "model"  # stands for the model's own angles, where a controller's name is asked for


class ControllerTable(StrictModel):
    """``[controllers.NAME]`` of ``robot.toml``: how the axes of a controller follow from the model's joints.

    ``c[i] = sense[i] · q[i] + zero_deg[i]``, plus ``factor · c[other]`` for each ``[axis, other, factor]`` of
    ``coupling``, axes counted from 1; or ``same = true``. ``limit_deg`` and ``speed_deg_s`` are the controller's axes'.
    Where joints slide, the controller's axes are those that turn and behind them those that slide, as external axes;
    ``zero_mm`` are the zeros of these, and ``limit_deg`` and ``speed_deg_s`` are not said. ``pulses_per_deg`` is for
    languages that count in pulses. ``base_mm`` is the origin of the controller's base frame in the model's, left
    out where it is not known: poses of languages whose makers lay it elsewhere need it.
    """

    same: bool = False
    sense: tuple[Literal[1, -1], ...] = ()
    zero_deg: tuple[Annotated[float, Field(ge=-MOST_ZERO_DEG, le=MOST_ZERO_DEG)], ...] = ()
    zero_mm: tuple[Coordinate, ...] = ()
    coupling: tuple[tuple[int, int, Annotated[float, Field(ge=-MOST_FACTOR, le=MOST_FACTOR)]], ...] = ()
    limit_deg: tuple[tuple[Coordinate, Coordinate], ...] = ()
    speed_deg_s: tuple[PositiveFloat, ...] = ()
    pulses_per_deg: tuple[PositiveFloat, ...] = ()
    base_mm: tuple[Coordinate, Coordinate, Coordinate] | None = None
    source: Annotated[OneLine, Field(min_length=1)]

    @model_validator(mode="after")
    def _check_statements(self) -> ControllerTable:
        if self.same and (self.sense or self.zero_deg or self.zero_mm or self.coupling):
            raise ValueError("same = true leaves no room for sense, zeros or coupling: give one of the two")
        if not self.same and not (self.sense and self.zero_deg):
            raise ValueError("give sense and zero_deg of every axis, or same = true where all count as the model's do")
        if (left := TO_FILL_IN.search(self.source)) is not None:
            raise ValueError(
                f"source still says {left[0]}: jog the axes at the robot first, then write there when that was, such "
                'as source = "jogged at the robot on 2026-03-02"'
            )
        if any(low >= high for low, high in self.limit_deg):
            raise ValueError("limit_deg: the lower limit must lie below the upper one")
        return self


@dataclass(frozen=True)
class AxisConvention:
    """How a controller of a robot with N joints counts its axes: ``c = M q + z``.

    Attributes:
        controller: name of the controller's language, such as ``pdl2``.
        matrix: M, (N, N); it has an inverse.
        zero: z, (N,) [rad].
        lower, upper: strokes of the controller's axes, (N,) [rad]; infinite where none is known.
        speed: full speeds of the controller's axes, (N,) [rad/s].
        source: where this is known from.
        pulses_per_deg: of each axis, for languages that count in pulses; none where it is not known.
        p_MC: origin of the controller's base frame in the model's, whose directions it has, (3,) [m]; None: not known.
    """

    controller: str
    matrix: Array
    zero: Array
    lower: Array
    upper: Array
    speed: Array
    source: str = ""
    pulses_per_deg: tuple[float, ...] = ()
    p_MC: tuple[float, ...] | None = None

    @classmethod
    def model_convention(
        cls, controller: str, lower: Array, upper: Array, speed: Array, source: str = ""
    ) -> AxisConvention:
        """Return the convention of a controller that counts as the model does, with its strokes and speeds."""
        n = len(speed)
        return cls(controller, read_only(np.eye(n)), read_only(np.zeros(n)), lower, upper, speed, source)

    @property
    def n_axes(self) -> int:
        """Number of axes N."""
        return len(self.zero)

    @property
    def is_same(self) -> bool:
        """Whether the controller counts as the model does."""
        return bool(np.array_equal(self.matrix, np.eye(self.n_axes)) and not self.zero.any())

    @property
    def is_coupled(self) -> bool:
        """Whether an axis counts with another one."""
        return bool((np.count_nonzero(self.matrix, axis=1) > 1).any())

    @property
    def different_axes(self) -> tuple[int, ...]:
        """Numbers, from 1, of the axes whose angles differ from those of the model's joints."""
        apart = (self.matrix != np.eye(self.n_axes)).any(axis=1) | (self.zero != 0.0)
        return tuple((np.flatnonzero(apart) + 1).tolist())

    @cached_property
    def inverse(self) -> Array:
        """Return the inverse of ``matrix``, (N, N)."""
        return read_only(np.linalg.inv(self.matrix))

    def to_controller(self, q: Array) -> Array:
        """Return the controller's angles of the model's q, both (…, N) [rad]."""
        return np.asarray(q if self.is_same else q @ self.matrix.T + self.zero)

    def to_model(self, c: Array) -> Array:
        """Return the model's angles of the controller's c, both (…, N) [rad]."""
        return np.asarray(c if self.is_same else (c - self.zero) @ self.inverse.T)

    def torque_to_model(self, torque: Array) -> Array:
        """Return the torques about the model's joints of those about the controller's axes, both (…, N) [Nm]."""
        return np.asarray(torque @ self.matrix)

    def degrees_to_controller(self, q_deg: Sequence[float]) -> tuple[float, ...]:
        """Return the controller's angles (N,) of the model's (N,), both in degrees, so that decimals stay decimals."""
        if self.is_same:
            return tuple(q_deg)
        c = np.asarray(q_deg) @ self.matrix.T + np.round(to_deg(self.zero), BORDER_DECIMALS)
        return tuple((np.round(c, BORDER_DECIMALS) + 0.0).tolist())

    def degrees_to_model(self, c_deg: Sequence[float]) -> tuple[float, ...]:
        """Return the model's angles (N,) of the controller's (N,), both in degrees, so that decimals stay decimals."""
        if self.is_same:
            return tuple(c_deg)
        q = (np.asarray(c_deg) - np.round(to_deg(self.zero), BORDER_DECIMALS)) @ self.inverse.T
        return tuple((np.round(q, BORDER_DECIMALS) + 0.0).tolist())

    def largest(self, rate: Array) -> Array:
        """Return how much each axis can change (N,) where each joint changes by ``rate`` (N,) at most, in its unit."""
        size = np.where(self.matrix == 0.0, 0.0, np.abs(self.matrix) * _clip_infinite(rate)).sum(axis=1)
        return read_only(_restore_infinite(size))

    def is_within(self, c: Array) -> np.ndarray:
        """Return whether each of the controller's angles (…, N) [rad] lies inside its stroke, (…, N) bool."""
        return np.asarray((c >= self.lower - STROKE_ROUNDING) & (c <= self.upper + STROKE_ROUNDING))

    def sentences(self, axes: Sequence[str]) -> tuple[str, ...]:
        """Return for each axis how it follows from the model's joints: ``A3 = -q3 - 90 deg``.

        ``axes``: names of the controller's axes.
        """
        zero = np.round(to_deg(self.zero), BORDER_DECIMALS)
        rows = enumerate(zip(axes, self.matrix, zero, strict=False))
        return tuple(f"{name} = {_terms(j, row, offset)}" for j, (name, row, offset) in rows)


def _terms(own: int, row: Array, offset: float) -> str:
    order = sorted(np.flatnonzero(row), key=lambda j: j != own)
    text = ""
    for j in order:
        size = f"{abs(row[j]):.6g} " if abs(row[j]) != 1.0 else ""
        sign = ("-" if row[j] < 0 else "") if not text else (" - " if row[j] < 0 else " + ")
        text += f"{sign}{size}q{j + 1}"
    return text + (f" {'-' if offset < 0 else '+'} {abs(offset):.9g} deg" if offset else "")


@dataclass(frozen=True)
class JointRange:
    """Limits (N,) [rad] and full speeds (N,) [rad/s] of the model's joints, which a controller's follow from.

    ``slides``: which of them slide, (N,) bool.
    """

    lower: Array
    upper: Array
    speed: Array
    slides: np.ndarray | None = None

    def controller_limits(self, matrix: Array, zero: Array) -> JointRange:
        """Return the limits of ``M q + z``, each axis alone: of axes that are coupled the widest that can occur."""
        ends = [
            np.where(matrix == 0.0, 0.0, matrix * end)
            for end in (_clip_infinite(self.lower), _clip_infinite(self.upper))
        ]
        low, high = np.minimum(*ends).sum(axis=1) + zero, np.maximum(*ends).sum(axis=1) + zero
        speed = np.where(matrix == 0.0, 0.0, np.abs(matrix) * _clip_infinite(self.speed)).max(axis=1)
        return JointRange(*(read_only(_restore_infinite(v)) for v in (low, high, speed)))


HUGE = 1e15  # stands for infinity where it is multiplied


def _clip_infinite(v: Array) -> Array:
    return np.clip(v, -HUGE, HUGE)


def _restore_infinite(v: Array) -> Array:
    return np.where(np.abs(v) > HUGE / 2, np.copysign(np.inf, v), v)


def convention_from_table(where: str, controller: str, table: ControllerTable, joints: JointRange) -> AxisConvention:
    """Return the axis convention in a ``[controllers.NAME]`` table, in SI units.

    Args:
        where: the robot's file, for messages.
        controller: NAME.
        table: the table.
        joints: limits and speeds of the model's joints; the controller's are those where the table says no others.

    Raises:
        InputError: the table has another number of axes than the robot joints, a coupling that makes no sense, or
            strokes that the model's joints leave.
    """
    n, at = len(joints.speed), f"{where}: [controllers.{controller}]"
    slides = np.zeros(n, dtype=bool) if joints.slides is None else joints.slides
    order = np.argsort(slides, kind="stable")  # those that turn come first
    _check_counts(at, table, n, int(slides.sum()))
    matrix: Array = np.eye(n)[order]
    zero: Array = np.zeros(n)
    if not table.same:
        back: Array = np.asarray(np.linalg.inv(np.eye(n) - _coupling(at, table, n, int(slides.sum()))), dtype=float)
        matrix = np.asarray(back @ np.diag([float(s) for s in table.sense]) @ matrix)
        zero = np.asarray(back @ from_deg((*table.zero_deg, *(table.zero_mm or (0.0,) * int(slides.sum())))))
    seen = joints.controller_limits(matrix, zero)
    lower, upper = (
        (from_deg(side) for side in zip(*table.limit_deg, strict=True)) if table.limit_deg else (seen.lower, seen.upper)
    )
    found = AxisConvention(
        controller=controller,
        matrix=read_only(matrix),
        zero=read_only(zero),
        lower=read_only(lower),
        upper=read_only(upper),
        speed=read_only(from_deg(table.speed_deg_s)) if table.speed_deg_s else seen.speed,
        source=table.source,
        pulses_per_deg=table.pulses_per_deg,
        p_MC=None if table.base_mm is None else tuple(from_mm(table.base_mm).tolist()),
    )
    _check_speeds(at, found, seen)
    if not found.is_coupled:
        _check_strokes(at, found, seen)
    return found


def _check_counts(at: str, table: ControllerTable, n: int, slides: int) -> None:
    """Refuse lists that have not a value for each axis; ``slides`` of the n joints slide."""
    most = {"sense": n, "zero_deg": n - slides, "zero_mm": slides, "limit_deg": n, "speed_deg_s": n}
    most["pulses_per_deg"] = n - slides
    for key, expected in most.items():
        count = len(getattr(table, key))
        if slides and count and key in ("limit_deg", "speed_deg_s"):
            raise InputError(f"{at} {key} is not for a robot with a joint that slides: the joints' own limits hold")
        if count not in (0, expected):
            which = "" if expected == n else " that slide" if key == "zero_mm" else " that turn"
            raise InputError(f"{at} {key} has {count} values, the robot has {expected} joints{which}")


def _coupling(at: str, table: ControllerTable, n: int, slides: int) -> Array:
    """Return K (n, n): each axis turns by K times the controller's other axes."""
    out = np.zeros((n, n))
    for axis, other, factor in table.coupling:
        if max(axis, other) > n - slides and slides:
            raise InputError(f"{at} coupling [{axis}, {other}, {factor:g}]: axes that slide count with no other")
        if not (1 <= axis <= n and 1 <= other <= n) or axis == other or factor == 0.0 or out[axis - 1, other - 1]:
            raise InputError(
                f"{at} coupling [{axis}, {other}, {factor:g}]: [axis, other_axis, factor] with two different axes of 1 "
                f"to {n}, each pair once, and a factor that is not 0 is allowed"
            )
        out[axis - 1, other - 1] = factor
    if np.linalg.matrix_power(out, n).any():
        raise InputError(
            f"{at} coupling: axes count with one another in a ring; each may count with others before it only"
        )
    return out


def _check_speeds(at: str, found: AxisConvention, seen: JointRange) -> None:
    """Refuse speeds of the controller's axes that are none beside those of the model's joints."""
    most_ratio = 20.0  # between full speeds of a controller's axis and the model's joints: more is a wrong unit
    known = np.isfinite(seen.speed) & (seen.speed > 0.0)
    ratio = np.where(known, found.speed / np.where(known, seen.speed, 1.0), 1.0)
    j = int(np.argmax(np.abs(np.log(ratio))))
    if np.abs(np.log(ratio[j])) > np.log(most_ratio):
        axis, own = np.rad2deg([found.speed[j], seen.speed[j]])
        raise InputError(
            f"{at} speed_deg_s of axis {j + 1} is {axis:g}, but by speed_deg_s of the joints it is {own:g}: over "
            f"{most_ratio:g} times more or less is no speed of the same axis; degrees per second are expected"
        )


def _check_strokes(at: str, found: AxisConvention, seen: JointRange) -> None:
    """Refuse strokes of the controller that the model's joints leave: a sense or a zero is likely to be wrong."""
    over = np.maximum(found.lower - _clip_infinite(seen.lower), _clip_infinite(seen.upper) - found.upper)
    over = np.where(over < HUGE / 2, over, 0.0)  # a joint without limits leaves no stroke
    j = int(np.argmax(over))
    if over[j] > STROKE_ROUNDING:
        low, high, own, end = np.rad2deg([found.lower[j], found.upper[j], seen.lower[j], seen.upper[j]])
        raise InputError(
            f"{at} limit_deg of axis {j + 1} is {low:g} … {high:g}, but limit_deg of joint {j + 1} reaches {own:g} … "
            f"{end:g} there: sense or zero_deg is wrong, or the joint's limits are too wide"
        )


COUPLING_ADVICE = (
    "    # coupling = [[3, 2, 1]]  # where the forearm keeps its direction as axis 2 alone is jogged: 1 where axis 2\n"
    "    #                         # and axis 3, each alone, turn it the same way, -1 where opposite ways (FANUC)\n"
)


def advice(controller: str, n: int, slides: int = 0) -> str:
    """Return the lines of TOML that state a convention, to be completed; ``slides`` of the n joints slide."""
    ones, zeros, travels = (", ".join([v] * k) for v, k in (("1", n), ("0", n - slides), ("0", slides)))
    more = f"    zero_mm = [{travels}]  # the same of those that slide, behind the others\n" if slides else ""
    return (
        f"    [controllers.{controller}]\n"
        f"    sense = [{ones}]  # -1 where the controller's axis counts the other way\n"
        f"    zero_deg = [{zeros}]  # what the controller shows where the model's joints stand at 0\n{more}"
        '    source = "jogged at the robot on <date>"\n'
        f"{COUPLING_ADVICE if n - slides > 2 else ''}"
        "or, where every axis counts as the model's does:\n"
        f"    [controllers.{controller}]\n"
        "    same = true\n"
        '    source = "jogged at the robot on <date>"'
    )


def names_of(conventions: Iterable[AxisConvention]) -> str:
    """Return the names of the controllers, for messages."""
    return ", ".join(sorted(c.controller for c in conventions)) or "none"
