"""The planned way, and how it is taken from anywhere on it."""

import numpy as np

from planner.instruments.centring.path import BallVisit, PlannedPath

BALLS = (BallVisit(1, "1", 1), BallVisit(2, "3", 4))


def way(*points):
    return PlannedPath("0123456789ab", "r", np.array(points, float)[:, None], BALLS)


def test_a_ball_is_approached_from_the_side_that_one_comes_from():
    w = way(0, 1, 2, 3, 4, 5)
    assert w.before(BALLS[1], 0) == 3
    assert w.before(BALLS[0], 5) == 2
    assert w.before(BALLS[0], 1) == 0  # from the ball itself: off it first
    assert w.between(5, 2) == [5, 4, 3, 2]  # the way leads through the ball


def test_a_ball_that_is_left_where_it_was_approached_is_passed_by():
    w = way(0, 1, 0, 3, 4, 3)
    assert w.between(0, 5) == [0, 2, 3, 5]
    assert w.between(5, 0) == [5, 3, 2, 0]
    assert w.between(1, 3) == [1, 2, 3]
    assert w.nearest(np.array([3.9])) == (4, np.float64(abs(3.9 - 4)))
