import re

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import blend_corners, plan_trajectory
from tests.motion.timing.arm import nj130

ARM = nj130()
LIMITS = Limits(ARM.speed, ARM.acceleration, ARM.jerk)
PATH = np.array([[0.0] * 6, [0.3] * 6, [0.1, 0.5, 0.2, 0.0, 0.3, 0.4]])


def plan(**changes):
    ask = {
        "path_q": PATH,
        "stop": [True, False, True],
        "blend_m": 0.01,
        "tool_speed": 0.1,
        "dwell": 0.0,
        "limits": LIMITS,
    }
    return plan_trajectory(**(ask | changes), tool_position=ARM.position, tool_jacobian=ARM.jacobian)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"path_q": PATH[:1]}, "two or more poses of 6 joints"),
        ({"path_q": PATH[:, :5]}, "shape (3, 5) cannot be timed"),
    ],
)
def test_bad_input_is_named(changes, words):
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        plan(**changes)
    assert caught.value.exit_code == 2


def test_one_dwell_serves_every_stop_and_no_other_point():
    assert plan(dwell=0.5).dwell.tolist() == [0.5, 0.0, 0.5]


def test_results_are_read_only_and_input_is_untouched():
    before = PATH.copy()
    trajectory = plan()
    assert np.array_equal(PATH, before)
    for name in ("waypoint_time", "leg_duration", "leg_peak_tool_speed", "entry", "exit", "dwell"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(trajectory, name)[0] = 1.0


def test_corners_can_be_had_without_timing():
    entry, leave, stop = blend_corners(
        PATH, stop=[True, False, True], blend_m=0.01, tool_position=ARM.position, limits=LIMITS, tool_speed=0.1
    )
    trajectory = plan()
    assert np.array_equal(entry, trajectory.entry)
    assert np.array_equal(leave, trajectory.exit)
    assert stop.tolist() == [True, False, True]
