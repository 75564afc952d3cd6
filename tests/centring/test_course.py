"""The planned way, and how it is taken from anywhere on it."""

import json

import numpy as np

from planner.centring.journal import BallVisit, PlannedPath, read_planned_path
from tests.centring.world import plan

BALLS = (BallVisit(1, "1", 1), BallVisit(2, "3", 4))


def way(*points):
    return PlannedPath("0123456789ab", "r", np.array(points, float)[:, None], BALLS)


def test_a_ball_is_approached_from_the_side_that_one_comes_from():
    w = way(0, 1, 2, 3, 4, 5)
    assert w.approach_point(BALLS[1], 0) == 3
    assert w.approach_point(BALLS[0], 5) == 2
    assert w.approach_point(BALLS[0], 1) == 0  # from the ball itself: off it first
    assert w.points_between(5, 2) == [5, 4, 3, 2]  # the way leads through the ball


def test_a_ball_that_is_left_where_it_was_approached_is_passed_by():
    w = way(0, 1, 0, 3, 4, 3)
    assert w.points_between(0, 5) == [0, 2, 3, 5]
    assert w.points_between(5, 0) == [5, 3, 2, 0]
    assert w.points_between(1, 3) == [1, 2, 3]
    assert w.nearest_point(np.array([3.9])) == (4, np.float64(abs(3.9 - 4)))


def test_past_balls_that_are_not_centred_it_takes_the_quickest_proven_legs():
    balls = tuple(BallVisit(k, "1", at) for k, at in enumerate((2, 5, 8, 11)))
    q = np.array([0, 10, 11, 10, 20, 21, 20, 30, 31, 30, 12, 13, 12, 0], float)[:, None]
    along = PlannedPath("0123456789ab", "r", q, balls)
    assert along.points_to_drive(3, 4) == along.points_between(3, 4) == [3, 4]  # no ball between: as planned
    assert along.points_to_drive(2, 10) == [2, 1, 0, 10]  # over the home pose, in which the way begins and ends
    assert along.points_to_drive(1, 13) == [1, 13]  # back where it came from: the end is the start
    short = PlannedPath("0123456789ab", "r", q, balls, joined=((0, 7),))
    assert short.points_to_drive(7, 12) == [7, 12]
    assert short.points_to_drive(4, 13) == [4, 1, 13]
    assert short.points_to_drive(7, 13) == [7, 13]


def test_shortcuts_of_the_plan_are_legs_of_the_roadmap(tmp_path):
    content = plan(3)
    content["drives"][0]["shortcuts"] = [3, 7]  # of the waypoints: before the first ball and after the third
    (tmp_path / "plan.json").write_text(json.dumps(content))
    read = read_planned_path(tmp_path / "plan.json")
    assert len(read.joined) == 2
    for (start, end), number in zip(read.joined, (3, 7), strict=True):
        np.testing.assert_allclose(np.degrees(read.q[start]), content["drives"][0]["waypoints"][0]["q_deg"])
        np.testing.assert_allclose(np.degrees(read.q[end]), content["drives"][0]["waypoints"][number]["q_deg"])
