"""From "cut the corner within so many millimetres" to the word that a controller has for it.

Each strategy returns the number to print, or None where the corner must be an exact stop because
the controller could not keep within the distance. Every number is rounded down.
"""

import math
from collections.abc import Callable

from planner.program.dialect import Blend, BlendKind
from planner.program.instructions import JointMove
from planner.program.numbers import floored

Leg = tuple[tuple[float, ...], JointMove]
"""Where a leg begins [deg], and the move."""

Strategy = Callable[[Leg, Leg, Blend], float | None]


def _none(_before: Leg, _after: Leg, _blend: Blend) -> float | None:
    return None


def _mm(before: Leg, _after: Leg, blend: Blend) -> float | None:
    return floored(before[1].blend_mm, blend.decimals) or None


def _percent(before: Leg, after: Leg, blend: Blend) -> float | None:
    """Percent of half the leg, so that neither the leg in nor the leg out is left or joined too far off."""
    half = max(before[1].travel_mm, after[1].travel_mm) / 2.0
    percent = 100.0 if half <= before[1].blend_mm else 100.0 * before[1].blend_mm / half
    return floored(percent, blend.decimals) or None


def _path_degrees(before: Leg, after: Leg, blend: Blend) -> float | None:
    """Distance along the joint path in degrees, at most half of the shorter leg."""
    limits = [math.dist(leg[0], leg[1].q_deg) / 2.0 for leg in (before, after)]
    for start, move in (before, after):
        if move.travel_mm > 0.0:
            limits.append(before[1].blend_mm * math.dist(start, move.q_deg) / move.travel_mm)
    return floored(min(limits), blend.decimals) or None


def _dense(before: Leg, after: Leg, blend: Blend) -> float | None:
    """The controller cannot be told millimetres: only a path given in small steps runs without stops."""
    step = max(abs(b - a) for leg in (before, after) for a, b in zip(leg[0], leg[1].q_deg, strict=True))
    return step if step <= blend.dense_deg else None


STRATEGIES: dict[BlendKind, Strategy] = {
    "none": _none,
    "mm": _mm,
    "percent": _percent,
    "path_degrees": _path_degrees,
    "dense": _dense,
}


def blend_values(home_deg: tuple[float, ...], moves: tuple[JointMove, ...], blend: Blend) -> list[float | None]:
    """Return for each move the value of its blend word, None for an exact stop."""
    strategy = STRATEGIES[blend.kind]
    starts = (home_deg, *(m.q_deg for m in moves))
    legs = list(zip(starts, moves, strict=False))
    values: list[float | None] = []
    for index, (start, move) in enumerate(legs):
        if move.blend_mm <= 0.0 or index + 1 == len(legs):
            values.append(None)
        else:
            values.append(strategy((start, move), legs[index + 1], blend))
    return values
