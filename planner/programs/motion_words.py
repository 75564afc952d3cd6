"""The numbers of blending and speed words: from millimetres and timing to what a controller takes, rounded down."""

import math
from collections.abc import Callable

from planner.common.errors import InputError
from planner.programs.dialect import BlendKind, BlendStyle, SpeedKind, SpeedStyle
from planner.programs.instructions import JointMove


def format_fixed(value: float, decimals: int) -> str:
    """Return ``value`` rounded to the nearest with ``decimals`` digits behind the point."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def round_down(value: float, decimals: int) -> float:
    """Return ``value`` rounded down, for what must not exceed a limit; 2.9999999999 counts as 3."""
    scale = 10.0**decimals
    return math.floor(value * scale * (1.0 + 1e-12) + 1e-9) / scale


Leg = tuple[tuple[float, ...], JointMove]
"""Where a leg begins [deg], and the move."""

BlendStrategy = Callable[[Leg, Leg, BlendStyle], float | None]


def _none(_before: Leg, _after: Leg, _blend: BlendStyle) -> float | None:
    return None


def _mm(before: Leg, _after: Leg, blend: BlendStyle) -> float | None:
    return round_down(before[1].blend_mm, blend.decimals) or None


def _percent(before: Leg, after: Leg, blend: BlendStyle) -> float | None:
    """Percent of half the leg, so that neither the leg in nor the leg out is left or joined too far off."""
    half = max(before[1].travel_mm, after[1].travel_mm) / 2.0
    percent = 100.0 if half <= before[1].blend_mm else 100.0 * before[1].blend_mm / half
    return round_down(percent, blend.decimals) or None


def _path_degrees(before: Leg, after: Leg, blend: BlendStyle) -> float | None:
    """Distance along the joint path in degrees, at most half of the shorter leg."""
    limits = [math.dist(leg[0], leg[1].q_deg) / 2.0 for leg in (before, after)]
    for start, move in (before, after):
        if move.travel_mm > 0.0:
            limits.append(before[1].blend_mm * math.dist(start, move.q_deg) / move.travel_mm)
    return round_down(min(limits), blend.decimals) or None


def _dense(before: Leg, after: Leg, blend: BlendStyle) -> float | None:
    """The controller cannot be told millimetres: only a path given in small steps runs without stops."""
    step = max(abs(b - a) for leg in (before, after) for a, b in zip(leg[0], leg[1].q_deg, strict=True))
    return step if step <= blend.dense_deg else None


BLEND_STRATEGIES: dict[BlendKind, BlendStrategy] = {
    "none": _none,
    "mm": _mm,
    "percent": _percent,
    "path_degrees": _path_degrees,
    "dense": _dense,
}


def blend_values(home_deg: tuple[float, ...], moves: tuple[JointMove, ...], blend: BlendStyle) -> list[float | None]:
    """Return for each move the value of its blend word, None for an exact stop."""
    strategy = BLEND_STRATEGIES[blend.kind]
    starts = (home_deg, *(m.q_deg for m in moves))
    legs = list(zip(starts, moves, strict=False))
    values: list[float | None] = []
    for index, (start, move) in enumerate(legs):
        if move.blend_mm <= 0.0 or index + 1 == len(legs):
            values.append(None)
        else:
            values.append(strategy((start, move), legs[index + 1], blend))
    return values


SpeedStrategy = Callable[[JointMove, int, SpeedStyle], float]

COARSE = 5.0
"""A printed whole percentage below this loses too much by rounding, if a smaller override can help [%]."""

_PER_UNIT = {"mm/s": 1.0, "mm/min": 60.0}


def _axis_percent(move: JointMove, override: int, _speed: SpeedStyle) -> float:
    return min(100.0, move.axis_percent * 100.0 / override)


def _tool_speed(move: JointMove, _override: int, speed: SpeedStyle) -> float:
    return max(move.tool_speed_mm_s, 0.1) * _PER_UNIT[speed.unit]


def _inverse_time(move: JointMove, _override: int, _speed: SpeedStyle) -> float:
    return 60.0 / move.duration_s  # the move takes 1/F minutes


SPEED_STRATEGIES: dict[SpeedKind, SpeedStrategy] = {
    "axis_percent": _axis_percent,
    "tool_speed": _tool_speed,
    "inverse_time": _inverse_time,
}


def speed_value(move: JointMove, override: int, speed: SpeedStyle) -> float:
    """Return the number of the speed word, rounded down to what is printed.

    Raises:
        InputError: the leg is slower than the smallest number of the dialect.
    """
    value = round_down(SPEED_STRATEGIES[speed.kind](move, override, speed), speed.decimals)
    if value <= 0.0:
        raise InputError(
            f"a leg with {move.axis_percent:g} % of axis speed and {move.duration_s:g} s is slower than this "
            "dialect can say; raise the measuring speed"
        )
    return value


def choose_overrides(moves: tuple[JointMove, ...], speed: SpeedStyle) -> list[int]:
    """Return the coarse override of each move [%], the same from one exact stop to the next.

    Whole percents of full axis speed are too coarse for measuring (1000 mm/min is often below 1 %):
    between two stops the largest override is taken that leaves every leg a percentage of 5 or more.
    """
    chosen: list[int] = []
    stretch: list[JointMove] = []
    for move in moves:
        stretch.append(move)
        if move.blend_mm <= 0.0:
            slowest = min(m.axis_percent for m in stretch)
            fits = [o for o in speed.overrides if slowest * 100.0 / o >= COARSE]
            chosen += [max(fits, default=min(speed.overrides))] * len(stretch)
            stretch = []
    return chosen
