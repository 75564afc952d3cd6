"""No feasible move is left untimed, however close to its limits, and every limit holds throughout."""

import numpy as np
import pytest

from planner.common.units import read_only
from planner.motion.timing.curve import Limits
from planner.motion.timing.phases import time_steps
from planner.motion.timing.profile import Steps, Stretches, choose_speeds
from planner.motion.timing.ramps import double_s_phases, ramp_length, travel_time
from tests.not_everywhere import ruckig

N = 20_000
HELD = 1.0 + 2e-6


def speeds(rng):
    """At rest, anywhere, exactly at the bound of 1, within rounding of it, and next to nothing."""
    near = 10 ** rng.uniform(-14, 0, N)
    return np.choose(rng.integers(0, 5, N), [np.zeros(N), rng.uniform(0.0, 1.0, N), np.ones(N), 1.0 - near, near])


def tight_moves(rng):
    """Moves whose change of speed fills the length but for 1e-13 to 10 parts of it, or exactly: all are possible."""
    v0, v1 = speeds(rng), speeds(rng)
    acceleration = 10 ** rng.uniform(-3, 4, N)
    jerk = acceleration / 10 ** rng.uniform(-4, 4, N)
    room = 10 ** rng.uniform(-13, 1, N) * (rng.random(N) < 0.8)
    length = ramp_length(v0, v1, acceleration, jerk) * (1.0 + room)
    return np.where(length > 0.0, length, 1.0), v0, v1, np.ones(N), acceleration, jerk


def ends_of(phases):
    t, s, v, a, j = phases.transpose(2, 0, 1)
    return s + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j


@pytest.mark.parametrize("seed", range(3))
def test_the_closed_form_is_one_smooth_move_from_end_to_end(seed):
    length, v0, v1, fastest, acceleration, jerk = moves = tight_moves(np.random.default_rng(seed))
    phases = double_s_phases(*moves)
    s, v, a = ends_of(phases)
    assert phases[:, :, 0].min() >= 0.0
    assert np.all(phases[:, 0, 1] == 0.0)
    np.testing.assert_array_equal(phases[:, 0, 2], v0)
    np.testing.assert_allclose(s[:, :-1], phases[:, 1:, 1], atol=1e-12 * length.max())
    np.testing.assert_allclose(v[:, :-1], phases[:, 1:, 2], atol=1e-14)
    np.testing.assert_allclose(a[:, :-1] / acceleration[:, None], phases[:, 1:, 3] / acceleration[:, None], atol=1e-12)
    np.testing.assert_allclose(s[:, -1], length, rtol=1e-12)
    np.testing.assert_allclose(v[:, -1], v1, atol=1e-14)
    assert np.all(np.abs(a[:, -1]) <= 1e-12 * acceleration)
    assert np.all(phases[:, :, 2] <= fastest[:, None] * (1.0 + 1e-12))
    assert np.all(np.abs(phases[:, :, 3]) <= acceleration[:, None] * (1.0 + 1e-12))
    assert np.all(np.abs(phases[:, :, 4]) <= jerk[:, None])


@pytest.mark.parametrize("seed", range(3))
def test_the_time_that_speeds_are_chosen_by_is_that_of_the_move(seed):
    moves = tight_moves(np.random.default_rng(seed))
    np.testing.assert_allclose(travel_time(*moves), double_s_phases(*moves)[:, :, 0].sum(axis=1), rtol=1e-3)


def test_the_closed_form_is_ruckigs_where_ruckig_has_room():
    rng = np.random.default_rng(0)
    v0, v1 = rng.uniform(0.0, 0.9, (2, 3000))
    acceleration, jerk = 10 ** rng.uniform(-1, 2, 3000), 10 ** rng.uniform(-1, 3, 3000)
    length = ramp_length(v0, v1, acceleration, jerk) * rng.uniform(1.01, 3.0, 3000) + rng.uniform(0.01, 1.0, 3000)
    mine = double_s_phases(length, v0, v1, np.ones(3000), acceleration, jerk)[:, :, 0].sum(axis=1)
    move, answer = ruckig.InputParameter(1), ruckig.Trajectory(1)
    move.max_velocity = [1.0]
    for k in range(3000):
        move.current_velocity, move.target_velocity, move.target_position = [v0[k]], [v1[k]], [length[k]]
        move.max_acceleration, move.max_jerk = [acceleration[k]], [jerk[k]]
        assert ruckig.Ruckig(1).calculate(move, answer) == ruckig.Result.Working
        assert answer.duration == pytest.approx(mine[k], rel=1e-7)


def timed(length, v0, v1, fastest, acceleration, jerk):
    """Time moves one after the other, each as a step of its own; returns the phases and the step of each."""
    count = len(length)
    edge = np.concatenate([[0.0], np.cumsum(length)])
    steps = Steps(np.arange(count), np.arange(count) + 1, length, fastest, acceleration, jerk, v0, v1)
    phases, arrival = time_steps(steps, edge, np.zeros(count + 1))
    step = np.searchsorted(edge[:-1], phases.begin, side="right") - 1  # the rest at the end counts with the last
    return phases, np.diff(arrival), step


def test_a_change_of_speed_that_fills_its_stretch_is_timed():
    """Ruckig alone refuses this one: 0.942 to its bound of 1 needs the whole stretch, to 1e-6 of it."""
    move = [np.array([x]) for x in (1.0, 0.9424631589201797, 1.0, 1.0, 0.5181883842744347, 0.217096700882396)]
    phases, took, _ = timed(*move)
    assert took[0] == pytest.approx(travel_time(*move)[0], rel=1e-6)
    assert phases.speed.max() <= 1.0
    assert phases.at(np.array([phases.duration * (1.0 - 1e-9)]))[1][0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_thousands_of_moves_at_the_edge_of_their_limits_are_timed_within_them(seed):
    rng = np.random.default_rng(seed)
    _, v0, v1, fastest, acceleration, jerk = tight_moves(rng)
    real = np.maximum(v0, v1) > 1e-6  # slower than that, a stretch as long as the others would take days
    v0, v1, fastest, acceleration, jerk = (x[real] for x in (v0, v1, fastest, acceleration, jerk))
    scale = ramp_length(v0, v1, acceleration, jerk)  # every move as long as its change of speed needs: 1
    scale = np.where(scale > 0.0, scale, 1.0)
    length = np.ones(len(v0)) * (1.0 + 10 ** rng.uniform(-13, 1, len(v0)))
    move = (length, v0, v1, fastest, acceleration * scale, jerk * scale**2)
    move = [x[np.isfinite(travel_time(*move))] for x in move]
    phases, took, step = timed(*move)
    assert len(took) > 0.5 * N
    np.testing.assert_allclose(took, travel_time(*move), rtol=2e-3, atol=1e-6)
    assert np.all(phases.speed >= -2e-6)
    assert np.all(phases.speed <= move[3][step] * HELD)
    assert np.all(np.abs(phases.acceleration) <= move[4][step] * HELD)
    assert np.all(np.abs(phases.jerk) <= move[5][step] * HELD)


@pytest.mark.parametrize("seed", range(150))
def test_random_stretches_and_limits_are_timed_within_every_limit(seed):
    """Stretches from micrometres to metres, alike or not, limits from sluggish to violent, rests anywhere."""
    rng = np.random.default_rng(seed)
    count, joints = int(rng.integers(2, 60)), int(rng.integers(1, 7))
    spread = rng.choice([0.0, 0.03, 1.0, 3.0])
    length = 10 ** (rng.uniform(-4, 0) + spread * rng.uniform(-1, 1, count))
    size = 10 ** (spread * rng.uniform(-1, 1, (3, count, joints)))
    d1, d2, d3 = size[0], size[1] * rng.choice([0.0, 1.0, 30.0]), size[2] * rng.choice([0.0, 1.0, 300.0])
    tool = np.where(rng.random(count) < 0.5, rng.choice([1 / 60, 0.25, 3.0]), np.inf)
    rest = rng.random(count + 1) < rng.choice([0.0, 0.2])
    rest[[0, -1]] = True
    edge = np.concatenate([[0.0], np.cumsum(length)])
    limits = Limits(*(10 ** rng.uniform(low, up, joints) for low, up in ((-2, 1), (-2, 2), (-2, 4))))
    steps = choose_speeds(Stretches(*map(read_only, (edge, d1, d2, d3, tool)), rest=rest), limits)
    phases, arrival = time_steps(steps, read_only(edge), np.zeros(count + 1))
    t = np.unique(np.concatenate([phases.t, np.linspace(0.0, phases.duration, 4000)]))
    s, v, a, j, _ = phases.at(t)
    k = np.clip(np.searchsorted(edge, s, side="right") - 1, 0, count - 1)
    inside = np.abs(s - edge[np.searchsorted(edge, s).clip(0, count)]) > 1e-7 * edge[-1]
    k, v, a, j = (x[inside] for x in (k, v, a, j))
    assert np.isfinite(phases.duration)
    assert np.all(np.diff(s) >= -1e-9 * edge[-1])
    assert np.all(v <= tool[k] * HELD)
    v, a, j = v[:, None], a[:, None], j[:, None]
    assert np.all(np.abs(d1[k] * v) <= limits.speed * HELD)
    assert np.all(d2[k] * v**2 + d1[k] * np.abs(a) <= limits.acceleration * HELD)
    assert np.all(d3[k] * v**3 + 3 * d2[k] * v * np.abs(a) + d1[k] * np.abs(j) <= limits.jerk * HELD)
    assert np.all(np.diff(arrival[np.isfinite(arrival)]) > 0.0)
