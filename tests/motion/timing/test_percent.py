import numpy as np
import pytest

from planner.motion.timing.curve import axis_percent
from tests.motion.timing.arm import nj130, random_arm


def peak_speed(arm, start, end, percent):
    """Drive one synchronised leg at this percentage and return the fastest the tool point gets, by differences."""
    duration = (np.abs(end - start) / arm.speed).max() / (percent / 100.0)
    x = arm.position(start + np.linspace(0.0, 1.0, 20001)[:, None] * (end - start))
    return np.linalg.norm(np.diff(x, axis=0), axis=1).max() * 20000 / duration


@pytest.mark.parametrize("seed", range(20))
def test_percentage_is_the_highest_that_keeps_the_tool_speed(seed):
    rng = np.random.default_rng(seed)
    arm = random_arm(rng) if seed % 2 else nj130()
    q = rng.uniform(-1.5, 1.5, (6, len(arm.a)))
    limit = rng.choice([1 / 60, 0.25, 2.0], 5)
    percent = axis_percent(q, tool_speed=limit, tool_jacobian=arm.jacobian, speed=arm.speed)
    for k in range(5):
        peak = peak_speed(arm, q[k], q[k + 1], percent[k])
        assert peak <= limit[k] * (1.0 + 1e-9)
        assert percent[k] == 100.0 or peak >= 0.999 * limit[k]


def test_legs_without_a_limit_or_without_motion_run_in_full():
    arm = nj130()
    q = np.array([[0.0] * 6, [0.5] * 6, [0.5] * 6])
    assert axis_percent(q, tool_speed=np.inf, tool_jacobian=arm.jacobian, speed=arm.speed).tolist() == [100.0, 100.0]
    assert axis_percent(q, tool_speed=0.01, tool_jacobian=arm.jacobian, speed=arm.speed)[1] == 100.0
