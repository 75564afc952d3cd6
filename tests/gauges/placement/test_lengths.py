"""Fixtures, tool balls and zero of a bar from lengths alone, against made-up truths."""

import numpy as np
import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.gauges.placement.lengths import place_lengths
from planner.gauges.placement.solver import FlangePoses
from tests.gauges.placement.arms import ARMS, ball_in, flange, shell

ERROR = 3e-3  # [m] of the robot, each axis


def case(seed, n=80, error=ERROR):
    rng = np.random.default_rng(seed)
    m, side = ball_in(rng, 0.0, 0.3), rng.uniform(-np.pi, np.pi)
    X = np.array([0.6 * np.cos(side), 0.6 * np.sin(side), rng.uniform(0.0, 0.5)])
    zero = float(rng.choice([0.0, 0.35, -0.2]))
    p, R = shell(rng, seed % 2, n, m, X)
    n = len(p)
    length = np.linalg.norm(R @ m + p + error * rng.normal(size=(n, 3)) - X, axis=1) + zero
    return p, R, length, m, X, zero, rng


def off(found, m, X):
    return max(np.linalg.norm(found.p_BX - X, axis=-1).max(), np.linalg.norm(found.p_FM - m, axis=-1).max())


@pytest.mark.long
def test_two_hundred_runs_are_placed_from_nothing():
    wrong = []
    for seed in range(200):
        p, R, length, m, X, zero, _ = case(seed, 40 + seed % 3 * 40)
        found = place_lengths(FlangePoses.of_one(p, R), length)
        if off(found, m, X) > 6 * ERROR or abs(found.zero - zero) > 6 * ERROR:
            wrong.append((seed, off(found, m, X)))
    assert len(wrong) <= 2, wrong


@pytest.mark.parametrize("seed", range(6))
def test_an_exact_robot_is_placed_exactly_despite_outliers(seed):
    p, R, length, m, X, zero, rng = case(seed, error=0.0)
    bad = rng.choice(len(length), 3, replace=False)
    length[bad] += [0.1, -0.2, 0.5]
    found = place_lengths(FlangePoses.of_one(p, R), length)
    assert off(found, m, X) < 1e-8
    assert found.zero == pytest.approx(zero, abs=1e-8)


@pytest.mark.parametrize("held", ["tool", "fixture"])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_known_is_held(held, seed):
    p, R, length, m, X, *_ = case(seed)
    tool, fixture = (m[None], None) if held == "tool" else (None, X[None])
    found = place_lengths(FlangePoses.of_one(p, R), length, p_FM=tool, p_BX=fixture)
    assert off(found, m, X) < 6 * ERROR
    assert tool is None or np.array_equal(found.p_FM, tool)
    assert fixture is None or np.array_equal(found.p_BX, fixture)


@pytest.mark.parametrize("seed", range(6))
def test_several_fixtures_and_balls_on_the_tool_share_one_zero(seed):
    rng = np.random.default_rng(seed)
    m = np.array([ball_in(rng, 0.05, 0.3) for _ in range(2)])
    X = np.array([[0.5, 0.2, 0.3], [-0.4, 0.4, 0.2]])
    parts = [(k, t, *shell(rng, 0, 40, m[t], X[k])) for k, t in ((0, 0), (1, 0), (1, 1))]
    p, R = (np.concatenate([part[j] for part in parts]) for j in (2, 3))
    place, point = (np.concatenate([np.full(len(part[2]), part[j]) for part in parts]) for j in (0, 1))
    x = np.einsum("nij,nj->ni", R, m[point]) + p + ERROR * rng.normal(size=p.shape)
    found = place_lengths(FlangePoses(p, R, place, point), np.linalg.norm(x - X[place], axis=1) + 0.3)
    assert off(found, m, X) < 8 * ERROR


def test_same_numbers_twice_and_long_runs_are_thinned():
    rng = np.random.default_rng(0)
    p, R = flange(ARMS[1], np.cumsum(rng.normal(size=(50000, 6)) * 0.01, axis=0))
    m, X = np.array([0.05, 0.0, 0.15]), np.array([0.5, 0.2, 0.3])
    length = np.linalg.norm(R @ m + p - X, axis=1) + ERROR * rng.normal(size=50000)
    one, two = (place_lengths(FlangePoses.of_one(p, R), length) for _ in range(2))
    assert np.array_equal(one.p_BX, two.p_BX)
    assert off(one, m, X) < 3 * ERROR


def test_a_wrist_that_never_turned_is_named():
    p, R, length, m, X, zero, _ = case(3)
    length = np.linalg.norm(m + p - X, axis=1) + zero
    with pytest.raises(NoSolutionError, match=r"tool point 1.*fixture 1.*turns about no axis"):
        place_lengths(FlangePoses.of_one(p, np.broadcast_to(np.eye(3), R.shape)), length)


def test_one_pose_all_the_time_and_too_few_rows_are_refused():
    p, R, length, *_ = case(3)
    with pytest.raises(NoSolutionError, match="do not determine"):
        place_lengths(FlangePoses.of_one(np.repeat(p[:1], 30, 0), np.repeat(R[:1], 30, 0)), np.full(30, length[0]))
    with pytest.raises(InputError, match=r"6 lengths .* 7 unknowns"):
        place_lengths(FlangePoses.of_one(p[:6], R[:6]), length[:6])


def test_a_place_without_a_sample_is_named():
    p, R, *_ = case(3)
    with pytest.raises(InputError, match="place 1, so it cannot"):
        FlangePoses(p, R, np.ones(len(p), int), np.zeros(len(p), int))
    with pytest.raises(InputError, match="no samples"):
        FlangePoses.of_one(p[:0], R[:0])
