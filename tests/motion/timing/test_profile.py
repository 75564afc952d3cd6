import itertools

import numpy as np
import pytest

from planner.common.units import read_only
from planner.motion.timing.curve import Limits
from planner.motion.timing.phases import time_steps
from planner.motion.timing.profile import Stretches, choose_speeds
from planner.motion.timing.ramps import ramp_length, reachable_speed, travel_time
from tests.not_everywhere import ruckig

N = 2000
ONE_JOINT = Limits(*np.array([[1.0], [4.0], [30.0]]))


def by_ruckig(length, v0, v1, fastest, acceleration, jerk):
    move, answer = ruckig.InputParameter(1), ruckig.Trajectory(1)
    move.current_velocity, move.target_velocity, move.target_position = [v0], [v1], [length]
    move.max_velocity, move.max_acceleration, move.max_jerk = [fastest], [acceleration], [jerk]
    assert ruckig.Ruckig(1).calculate(move, answer) == ruckig.Result.Working
    return answer.duration


def random_moves(rng):
    v0, v1 = rng.uniform(0.0, 1.0, (2, N)) * rng.choice([0.0, 1.0], (2, N), p=[0.3, 0.7])
    acceleration, jerk = 10 ** rng.uniform(-1, 2, N), 10 ** rng.uniform(-1, 3, N)
    length = ramp_length(v0, v1, acceleration, jerk) * (1.0 + 10 ** rng.uniform(-6, 1, N)) + 10 ** rng.uniform(-6, 0, N)
    return length, v0, v1, np.maximum(v0, v1) * rng.uniform(1.0, 2.0, N) + 0.01, acceleration, jerk


def test_travel_time_agrees_with_ruckig():
    moves = random_moves(np.random.default_rng(0))
    mine = travel_time(*moves)
    other = np.array([by_ruckig(*move) for move in zip(*(column.tolist() for column in moves), strict=True)])
    assert np.all(np.abs(mine - other) <= 2e-3 * other)


def test_what_cannot_be_done_takes_forever():
    rows = np.array(random_moves(np.random.default_rng(1)))
    length, v0, v1, fastest, acceleration, jerk = rows[:, np.abs(rows[1] - rows[2]) > 1e-6]
    need = ramp_length(v0, v1, acceleration, jerk)
    assert np.all(np.isfinite(travel_time(1.001 * need, v0, v1, fastest, acceleration, jerk)))
    assert np.all(np.isinf(travel_time(0.999 * need, v0, v1, fastest, acceleration, jerk)))
    assert np.all(np.isinf(travel_time(length, v0, v1, 0.99 * np.maximum(v0, v1), acceleration, jerk)))


def test_reachable_inverts_the_length_of_a_ramp():
    rng = np.random.default_rng(2)
    v0 = rng.uniform(0.0, 1.0, N) * rng.choice([0.0, 1.0], N)
    length, acceleration, jerk = 10 ** rng.uniform(-4, 1, N), 10 ** rng.uniform(-1, 2, N), 10 ** rng.uniform(-1, 3, N)
    top = reachable_speed(v0, length, acceleration, jerk)
    change = np.maximum((top - v0) / np.maximum(top, 1e-300), 1e-16)
    assert np.all(np.abs(ramp_length(v0, top, acceleration, jerk) - length) <= length * (1e-9 + 1e-15 / change))


def small_problem(rng, count):
    """Return stretches of one joint, whose own limits are all that counts, and the joint's limits."""
    width = rng.uniform(0.05, 1.0, count)
    d1 = rng.uniform(0.2, 3.0, (count, 1))
    rest = np.zeros(count + 1, dtype=bool)
    rest[[0, -1]] = True
    none = np.zeros((count, 1))
    edge = np.concatenate([[0.0], np.cumsum(width)])
    tool = rng.choice([np.inf, 0.3, 1.0], count)
    return Stretches(read_only(edge), read_only(d1), none, none, read_only(tool), rest), Limits(
        *np.array([[1.0], [4.0], [30.0]])
    )


@pytest.mark.parametrize("seed", range(20))
def test_the_choice_is_as_good_as_a_search_over_all_speeds_on_single_stretches(seed):
    rng = np.random.default_rng(seed)
    stretches, limits = small_problem(rng, 4)
    steps = choose_speeds(stretches, limits)
    assert steps.first[0] == 0
    assert np.array_equal(steps.last[:-1], steps.first[1:])
    assert np.array_equal(steps.v1[:-1], steps.v0[1:])
    fastest = np.minimum(1.0 / stretches.d1[:, 0], stretches.tool)
    grid = np.linspace(0.02, 1.0, 14)
    cap = np.minimum(fastest[:-1], fastest[1:])
    speeds = np.array([[0.0, *row, 0.0] for row in itertools.product(*(grid * c for c in cap))])
    acceleration, jerk = 4.0 / stretches.d1[:, 0], 30.0 / stretches.d1[:, 0]
    length = np.diff(stretches.edge)
    legs = [
        travel_time(length[i], speeds[:, i], speeds[:, i + 1], fastest[i], acceleration[i], jerk[i]) for i in range(4)
    ]
    assert steps.time().sum() <= np.sum(legs, axis=0).min() * 1.02


@pytest.mark.parametrize("seed", range(20))
def test_stretches_that_are_alike_are_driven_as_one(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 40))
    edge = np.linspace(0.0, 1.0, count + 1)
    rest = np.zeros(count + 1, dtype=bool)
    rest[[0, -1]] = True
    ones, none = np.ones((count, 1)), np.zeros((count, 1))
    stretches = Stretches(read_only(edge), read_only(ones), none, none, read_only(np.full(count, np.inf)), rest)
    limits = Limits(*np.array([[2.0], [4.0], [30.0]]))
    phases, arrival = time_steps(choose_speeds(stretches, limits), stretches.edge, np.zeros(count + 1))
    best = by_ruckig(1.0, 0.0, 0.0, 2.0, 4.0, 30.0)
    assert best * (1.0 - 1e-9) <= phases.duration <= 1.12 * best
    assert arrival[-1] == phases.duration
    assert phases.speed.max() <= 2.0 * (1.0 + 1e-9)
