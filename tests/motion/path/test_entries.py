"""The way to a later start: only proven legs, and the quickest of them."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.programs.instructions import Comment, Instruction, JointMove, StretchBegin
from planner.runs.run import FIRST_MOUNTING
from planner.session.plan_types import TimedPath
from planner.session.tour_cost import cut_stretches, entry_paths, leg_times, tour_costs


@pytest.mark.parametrize("seed", range(3))
def test_ways_use_the_path_and_its_shortcuts_only_and_none_is_quicker(seed):
    rng = np.random.default_rng(seed)
    cell = load_cell("kuka-kr6-r700/edbb")
    q = cell.home + rng.uniform(-0.3, 0.3, (9, 6))
    shortcuts = sorted(rng.choice(np.arange(2, 9), 2, replace=False).tolist())
    allowed = {frozenset((k, k + 1)) for k in range(8)} | {frozenset((0, k)) for k in shortcuts}
    seconds = {leg: leg_times(cell, FIRST_MOUNTING, *(q[[k]] for k in sorted(leg)))[0] + 1e-3 for leg in allowed}
    best = np.full(9, np.inf)
    best[0] = 0.0
    for _ in range(9):  # Bellman and Ford
        for leg, time in seconds.items():
            a, b = sorted(leg)
            best[b], best[a] = min(best[b], best[a] + time), min(best[a], best[b] + time)
    for point, way in enumerate(entry_paths(cell, FIRST_MOUNTING, q, shortcuts)):
        legs = [frozenset(pair) for pair in pairwise(way)]
        assert way[0] == 0
        assert way[-1] == point
        assert set(legs) <= allowed
        assert sum(seconds[leg] for leg in legs) == pytest.approx(best[point])


def test_the_slowest_axis_sets_the_pace_where_that_is_asked_for():
    cell = load_cell("kuka-kr6-r700/edbb")
    cell = replace(cell, motion=replace(cell.motion, order="slowest-axis"))
    q = np.zeros((3, 6))
    q[1:, 0], q[2, 3] = cell.robot.speed[0], -3.0 * cell.robot.speed[3]  # one second, and three
    assert tour_costs(cell, FIRST_MOUNTING, q) == pytest.approx(np.array([[0, 1, 3], [1, 0, 3], [3, 3, 0]]))


@pytest.mark.parametrize("steps", [1, 3])
def test_every_start_is_named_by_the_pose_that_it_measures_first(steps):
    """Also where the moves to a pose are many small ones, of which the last alone carries its number."""
    cell = load_cell("kuka-kr6-r700/edbb")
    visit = np.array([-1, 1, -1, 2, 3, -1, 3, 2, -1, 1, -1])  # there, and back the same way
    q = cell.home + np.linspace(0.0, 0.3, 6)[np.array([0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0]), None] * np.ones(6)
    written: list[tuple[int, Instruction]] = []
    for k in range(10):
        move = JointMove(tuple(np.rad2deg(q[k + 1])), 1.0, 10.0, 5.0)
        pose = None if visit[k + 1] < 0 else int(visit[k + 1])
        written += [(k if pose is not None and not i else -1, move) for i in range(steps - 1)]
        written.append((k if pose is not None and steps == 1 else -1, replace(move, pose=pose)))
    path = TimedPath(q, visit, np.zeros(11), None)
    said, measured = {}, {}
    number = 1
    for item in cut_stretches(cell, FIRST_MOUNTING, path, (), written, 1):
        if isinstance(item, StretchBegin):
            number = item.until
        if isinstance(item, Comment):
            start, pose = map(int, re.fullmatch(r"start (\d+): pose (\d+)", item.text).groups())
            said[start] = pose
        if isinstance(item, JointMove) and item.pose is not None:
            measured.setdefault(number, item.pose)
    assert measured == {1: 1, 2: 2, 3: 3, 4: 3, 5: 2, 6: 1}
    assert said == {4: 3, 5: 2, 6: 1}
