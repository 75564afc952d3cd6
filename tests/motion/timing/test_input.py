import numpy as np
import pytest

from planner.common.errors import InputError
from planner.motion.timing.limits import Limits, axis_percent
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
        ({"path_q": PATH[:1]}, "two or more"),
        ({"path_q": np.where(PATH == 0.5, np.nan, PATH)}, "finite"),
        ({"path_q": PATH[:, :5]}, "5 joints and the limits 6"),
        ({"stop": [True, True]}, "one flag per path point"),
        ({"blend_m": [0.01, -0.01, 0.01]}, "-0.01 m"),
        ({"blend_m": np.inf}, "inf m"),
        ({"blend_m": [0.01, 0.01]}, "one number or 3"),
        ({"tool_speed": 0.0}, "tool speed holds 0 m/s"),
        ({"tool_speed": [0.1, np.nan]}, "nan"),
        ({"dwell": [0.0, 1.0, 0.0]}, "make it a stop"),
        ({"dwell": [0.0, 0.0, -1.0]}, "-1 s"),
    ],
)
def test_bad_input_is_named(changes, words):
    with pytest.raises(InputError, match=words) as caught:
        plan(**changes)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("bad", [0.0, -1.0, np.inf, np.nan])
@pytest.mark.parametrize("name", ["speed", "acceleration", "jerk"])
def test_limits_must_be_positive_and_finite(name, bad):
    values = {"speed": ARM.speed, "acceleration": ARM.acceleration, "jerk": ARM.jerk}
    values[name] = np.where(np.arange(6) == 3, bad, values[name])
    with pytest.raises(InputError, match=f"joint 4 has a {name} limit"):
        Limits(**values)


def test_limits_of_different_lengths_are_refused():
    with pytest.raises(InputError, match="jerk limits have shape"):
        Limits(ARM.speed, ARM.acceleration, ARM.jerk[:5])


def test_percent_checks_its_input_too():
    with pytest.raises(InputError, match="tool speed"):
        axis_percent(PATH, tool_speed=-1.0, tool_jacobian=ARM.jacobian, limits=LIMITS)


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
