"""The watch over one centring, reading by reading."""

import numpy as np
import pytest

from planner.centring.procedure import FollowingCheck
from planner.centring.settings import MoveSettings
from planner.centring.stop import DivergingError, StuckError

MM = 1e-3


def watch(*readings, moves, to_tool=None):
    """A watch that has seen the readings [mm], with the moves [mm] between them."""
    made = FollowingCheck(np.eye(3) if to_tool is None else np.array(to_tool), MoveSettings())
    for k, reading in enumerate(readings):
        if k:
            made.note_move(np.array(moves[k - 1]) * MM)
        made.check(np.array(reading) * MM)


def test_a_tilted_head_is_no_fault():
    watch((3.0, 0.1, 0.0), (1.0, 0.17, -0.07), (0.0, 0.2, -0.1), moves=[(2.0, 0.0, 0.0), (1.0, 0.0, 0.0)])


def test_a_head_turned_in_the_tool_frame():
    quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # x of the head is y of the tool
    watch((2.0, 0.0, 0.0), (1.0, 0.0, 0.0), moves=[(0.0, 1.0, 0.0)], to_tool=quarter)
    with pytest.raises((StuckError, DivergingError)):
        watch((2.0, 0.0, 0.0), (1.0, 0.0, 0.0), moves=[(0.0, 1.0, 0.0)])


def test_what_followed_at_first_and_then_sticks():
    with pytest.raises(StuckError, match="indicator x changed by"):
        watch((3.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.5, 0.0, 0.0), moves=[(2.5, 0.0, 0.0), (0.5, 0.0, 0.0)])


def test_what_creeps_in_small_moves():
    small = [(0.04, 0.0, 0.0)] * 4
    with pytest.raises(StuckError, match="indicator x changed by"):
        watch(*[(0.04, 0.0, 0.0)] * 5, moves=small)
    watch(*[(0.04, 0.0, 0.0)] * 3, moves=small)  # three of them may be chance


def test_a_ball_that_is_pushed_away():
    with pytest.raises(DivergingError, match=r"was 0\.100 mm from the centre and is 0\.906 mm"):
        watch((0.1, 0.0, 0.0), (0.1, 0.0, 0.9), moves=[(0.1, 0.0, 0.0)])
    watch((0.1, 0.0, 0.0), (0.1, 0.0, 0.15), moves=[(0.1, 0.0, 0.0)])  # an arm that lands so far off may come back
