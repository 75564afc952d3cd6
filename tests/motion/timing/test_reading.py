"""A gauge that is held at the tool: its rate and acceleration limits hold along the whole trajectory."""

import numpy as np
import pytest

from planner.motion.timing.curve import Limits, ReadingLimits
from planner.motion.timing.trajectory import check_limits, plan_trajectory
from tests.motion.timing.arm import nj130
from tests.motion.timing.bound import KEPT, largest_share

ARM = nj130()

PLACE = np.array([1.3, 0.4, 0.3])


def _length(q):
    return np.linalg.norm(ARM.position(q) - PLACE, axis=1)


def _direction(q):
    r = ARM.position(q) - PLACE
    return r / np.linalg.norm(r, axis=1)[:, None]


@pytest.mark.parametrize(("rate", "acceleration"), [(0.02, 1.0), (0.5, 0.05), (0.05, 0.02)])
def test_rate_and_acceleration_of_the_reading_are_kept_and_used(rate, acceleration):
    rng = np.random.default_rng(3)
    q = rng.uniform(-1.0, 1.0, (8, 6))
    stop = np.array([True, False, False, True, False, False, False, True])
    n = q.shape[1]
    limits = Limits(np.full(n, 2.0), np.full(n, 8.0), np.full(n, 80.0))
    reading = ReadingLimits(rate, acceleration, _length, _direction)
    asked = {"stop": stop, "blend_m": 0.02, "tool_position": ARM.position, "tool_jacobian": ARM.jacobian}
    free = plan_trajectory(q, **asked, limits=limits, tool_speed=0.5)
    held = plan_trajectory(q, **asked, limits=limits, tool_speed=0.5, reading=reading)
    t = np.linspace(0.0, held.duration_s, 40_001)
    length, step = _length(held.at(t).q), t[1]
    seen = np.abs(np.diff(length)).max() / step
    bend = np.abs(np.diff(length, 2)).max() / step**2
    assert seen <= rate * (1 + 1e-6)
    assert bend <= acceleration * (1 + 1e-4)
    assert max(seen / rate, bend / acceleration) > 0.8, "a limit that binds is used"
    assert held.duration_s > free.duration_s
    report = check_limits(held, limits, 0.05, reading)
    assert largest_share(report) <= KEPT
    assert max(report.reading_rate, report.reading_acceleration) > 0.8
    assert largest_share(check_limits(free, limits, 0.05, reading)) > KEPT
