"""From a leg's timing to the word that a controller has for speed; every number is rounded down."""

from collections.abc import Callable

from planner.errors import InputError
from planner.program.dialect import Speed, SpeedKind
from planner.program.instructions import JointMove
from planner.program.numbers import floored

Strategy = Callable[[JointMove, int, Speed], float]

COARSE = 5.0
"""A printed whole percentage below this loses too much by rounding, if a smaller override can help [%]."""

_PER_UNIT = {"mm/s": 1.0, "mm/min": 60.0}


def _axis_percent(move: JointMove, override: int, _speed: Speed) -> float:
    return min(100.0, move.axis_percent * 100.0 / override)


def _tool_speed(move: JointMove, _override: int, speed: Speed) -> float:
    return max(move.tool_speed_mm_s, 0.1) * _PER_UNIT[speed.unit]


def _inverse_time(move: JointMove, _override: int, _speed: Speed) -> float:
    return 60.0 / move.duration_s  # the move takes 1/F minutes


STRATEGIES: dict[SpeedKind, Strategy] = {
    "axis_percent": _axis_percent,
    "tool_speed": _tool_speed,
    "inverse_time": _inverse_time,
}


def speed_value(move: JointMove, override: int, speed: Speed) -> float:
    """Return the number of the speed word, rounded down to what is printed.

    Raises:
        InputError: the leg is slower than the smallest number of the dialect.
    """
    value = floored(STRATEGIES[speed.kind](move, override, speed), speed.decimals)
    if value <= 0.0:
        raise InputError(
            f"a leg with {move.axis_percent:g} % of axis speed and {move.duration_s:g} s is slower than this "
            "dialect can say; raise the measuring speed"
        )
    return value


def overrides(moves: tuple[JointMove, ...], speed: Speed) -> list[int]:
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
