"""The numbers of blending and speed words: from millimetres and timing to what a controller takes, rounded down."""

import math
from itertools import pairwise

from planner.common.errors import InputError
from planner.programs.instructions import JointMove
from planner.programs.motion_styles import BlendStyle, SpeedStyle

Leg = tuple[tuple[float, ...], JointMove]
"""Where a leg begins [deg], and the move."""


def format_fixed_point(value: float, decimals: int) -> str:
    """Return ``value`` rounded to the nearest with ``decimals`` digits behind the point: never an exponent or -0."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def round_down(value: float, decimals: int) -> float:
    """Return ``value`` rounded down, for what must not exceed a limit; 2.9999999999 counts as 3."""
    scale = 10.0**decimals
    return math.floor(value * scale * (1.0 + 1e-12) + 1e-9) / scale


def blend_values(home_deg: tuple[float, ...], moves: tuple[JointMove, ...], blend: BlendStyle) -> list[float | None]:
    """Return for each move the number of its blend word.

    None is an exact stop: planned, or because the controller could not keep within the distance.
    """
    starts = (home_deg, *(m.q_deg for m in moves))
    legs = pairwise(zip(starts, moves, strict=False))
    values = [_blend_value(before, after, blend) if before[1].blend_mm > 0.0 else None for before, after in legs]
    return [*values, None]


def _blend_value(before: Leg, after: Leg, blend: BlendStyle) -> float | None:
    """Return how far a corner may be cut so that neither the leg in nor the leg out is left too far off."""
    legs, cut_mm = (before, after), before[1].blend_mm
    circles = [move.via_deg is not None for _, move in legs]
    if any(circles):  # pieces of one circle go over into each other; to a leg of another kind it is a stop
        return cut_mm if all(circles) else None
    match blend.kind:
        case "none":
            return None
        case "mm":
            value = cut_mm
        case "percent":  # of half the leg: the longer one decides
            half = max(move.travel_mm for _, move in legs) / 2.0
            value = 100.0 if half <= cut_mm else 100.0 * cut_mm / half
        case "path_degrees":  # along the joint path, at most half of the shorter leg
            lengths = [(math.dist(start, move.q_deg), move.travel_mm) for start, move in legs]
            limits = [cut_mm * length / travel_mm for length, travel_mm in lengths if travel_mm > 0.0]
            value = min([length / 2.0 for length, _ in lengths] + limits)
        case "dense":  # the controller cannot be told millimetres: only a path in small steps runs without stops
            step = max(abs(b - a) for start, move in legs for a, b in zip(start, move.q_deg, strict=True))
            return step if step <= blend.dense_deg else None
    return round_down(value, blend.decimals) or None


def speed_value(
    move: JointMove, reduction: int, speed: SpeedStyle, start_deg: tuple[float, ...] = (), exact: bool = True
) -> float:
    """Return the number of the speed word of a move from ``start_deg``, rounded to the slower of what can be printed.

    ``exact``: the move ends at rest.

    Raises:
        InputError: the leg is slower than the smallest number of the dialect.
    """
    match speed.kind:
        case "axis_percent":
            value = min(100.0, move.axis_percent * 100.0 / reduction)
        case "tool_speed":
            value = max(move.tool_speed_mm_s, 0.1) * (60.0 if speed.unit == "mm/min" else 1.0)
        case "inverse_time":  # the move takes 1/F minutes
            value = 60.0 / move.duration_s
        case "leading_axis":
            value = leading_speed(move, start_deg) or 1.0  # a leg of no length has no speed
        case "duration":
            seconds = move.duration_s * (speed.ease if exact else 1.0) + speed.ramp_s
            return -round_down(-seconds, speed.decimals)
    value = round_down(value, speed.decimals)
    if value <= 0.0:
        raise InputError(
            f"a segment with {move.axis_percent:g} % of axis speed and {move.duration_s:g} s is slower than this "
            "dialect can say; raise the measuring speed"
        )
    return value


def leading_speed(move: JointMove, start_deg: tuple[float, ...]) -> float:
    """Return the planned speed of the axis that turns furthest [deg/s]."""
    return max(abs(b - a) for a, b in zip(start_deg, move.q_deg, strict=True)) / move.duration_s


def choose_reductions(moves: tuple[JointMove, ...], speed: SpeedStyle) -> list[int]:
    """Return the program's own coarse reduction of each move [%], the same from one exact stop to the next.

    Whole percents of full axis speed are too coarse for measuring (1000 mm/min is often below 1 %):
    between two stops the largest reduction is taken that leaves every leg a percentage of 5 or more.
    """
    chosen: list[int] = []
    stretch: list[JointMove] = []
    for move in moves:
        stretch.append(move)
        if move.blend_mm <= 0.0:
            slowest = min(m.axis_percent for m in stretch)
            # 5.0: [%] a printed whole percentage below this loses too much by rounding, if a smaller reduction can help
            fits = [r for r in speed.reductions if slowest * 100.0 / r >= 5.0]
            chosen += [max(fits, default=min(speed.reductions))] * len(stretch)
            stretch = []
    return chosen
