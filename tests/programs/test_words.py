"""The numbers behind speed and rounding words keep what they must not exceed, for any legs."""

import math

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.programs.instructions import JointMove
from planner.programs.motion_styles import BlendStyle, SpeedStyle
from planner.programs.motion_words import blend_values, choose_reductions, format_fixed_point, round_down, speed_value

PERCENT = SpeedStyle(kind="axis_percent", unit="%", decimals=0, reductions=(100, 50, 20, 10, 5, 2, 1))


def _legs(seed: int) -> tuple[tuple[float, ...], tuple[JointMove, ...]]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-90.0, 90.0, (8, 6)) * 10.0 ** rng.uniform(-2, 0, (8, 1))
    moves = tuple(
        JointMove(
            tuple(row),
            duration_s=float(10.0 ** rng.uniform(-1, 2)),
            tool_speed_mm_s=float(10.0 ** rng.uniform(0, 3)),
            axis_percent=float(10.0 ** rng.uniform(-1, 2)),
            blend_mm=0.0 if i in (0, 6) else float(rng.choice([0.0, 5.0, 10.0])),
        )
        for i, row in enumerate(q[1:].tolist())
    )
    return tuple(q[0].tolist()), moves


@pytest.mark.parametrize("seed", range(30))
def test_percent_of_half_a_leg_keeps_the_distance(seed: int) -> None:
    home, moves = _legs(seed)
    for i, value in enumerate(blend_values(home, moves, BlendStyle(kind="percent"))):
        if value is not None:
            assert 1 <= value <= 100
            for leg in moves[i : i + 2]:
                assert value / 100.0 * leg.travel_mm / 2.0 <= moves[i].blend_mm * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_path_degrees_keep_the_distance_and_half_the_leg(seed: int) -> None:
    home, moves = _legs(seed)
    points = (home, *(m.q_deg for m in moves))
    for i, value in enumerate(blend_values(home, moves, BlendStyle(kind="path_degrees", decimals=3))):
        if value is not None:
            for leg in (i, i + 1):
                length = math.dist(points[leg], points[leg + 1])
                assert value <= length / 2.0 + 1e-9
                assert value / length * moves[leg].travel_mm <= moves[i].blend_mm * (1 + 1e-9)


@pytest.mark.parametrize("kind", ["none", "mm", "percent", "path_degrees", "dense"])
@pytest.mark.parametrize("seed", range(10))
def test_a_planned_stop_stays_one(kind: str, seed: int) -> None:
    home, moves = _legs(seed)
    values = blend_values(home, moves, BlendStyle.model_validate({"kind": kind}))
    assert all(v is None for v, m in zip(values, moves, strict=True) if m.blend_mm == 0.0)


@pytest.mark.parametrize("seed", range(30))
def test_percent_times_reduction_is_below_the_limit_and_not_far(seed: int) -> None:
    _, moves = _legs(seed)
    chosen = choose_reductions(moves, PERCENT)
    for i, (move, reduction) in enumerate(zip(moves, chosen, strict=True)):
        effective = speed_value(move, reduction, PERCENT) * reduction / 100.0
        assert effective <= move.axis_percent * (1 + 1e-9)
        assert effective <= reduction
        if i and moves[i - 1].blend_mm > 0.0:
            assert reduction == chosen[i - 1]  # never changed while the robot runs through
        if move.blend_mm == 0.0 and (i == 0 or moves[i - 1].blend_mm == 0.0) and move.axis_percent >= 0.1:
            assert effective >= 0.83 * move.axis_percent


def test_measuring_at_half_a_percent_is_not_driven_at_one() -> None:
    move = JointMove((0.0,) * 6, 12.0, 16.667, 0.48)
    (reduction,) = choose_reductions((move,), PERCENT)
    assert speed_value(move, reduction, PERCENT) * reduction / 100.0 == pytest.approx(0.45)


def test_inverse_time_is_never_too_short() -> None:
    speed = SpeedStyle(kind="inverse_time", unit="1/min", decimals=4)
    for duration in (0.0123, 0.7, 3.0, 7.0, 1234.5):
        move = JointMove((0.0,) * 6, duration, 10.0, 1.0)
        assert 60.0 / speed_value(move, 100, speed) >= duration * (1 - 1e-12)


def test_a_leg_too_slow_to_say_is_refused() -> None:
    with pytest.raises(InputError, match="slower than this dialect can say"):
        speed_value(JointMove((0.0,) * 6, 10.0, 1.0, 0.004), 1, PERCENT)


def test_numbers_are_plain() -> None:
    assert format_fixed_point(-0.00004, 4) == "0.0000"
    assert format_fixed_point(1e-9, 4) == "0.0000"
    assert format_fixed_point(-0.00006, 4) == "-0.0001"
    assert format_fixed_point(123456.789, 2) == "123456.79"
    assert round_down(2.9999999999999996, 0) == 3.0
    assert round_down(0.29999, 4) == 0.2999
    assert round_down(16.6667, 2) == 16.66
