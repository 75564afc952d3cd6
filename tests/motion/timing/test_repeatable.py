import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import plan_trajectory
from tests.motion.timing.arm import nj130
from tests.processors import with_threads

ARM = nj130()

SCRIPT = """
import hashlib
from tests.motion.timing.test_repeatable import drive
state = drive().sample(0.05)
print(hashlib.sha256(b"".join(x.tobytes() for x in (state.t, state.q, state.dddq, state.tool_speed))).hexdigest())
"""


def drive():
    q = np.random.default_rng(3).uniform(-0.5, 0.5, (12, 6))
    stop = np.zeros(12, dtype=bool)
    stop[5] = True
    limits = Limits(ARM.speed, ARM.acceleration, ARM.jerk)
    speed = np.where(np.arange(11) % 3 == 0, np.inf, 0.25)
    asked = {"stop": stop, "blend_m": 0.01, "limits": limits, "tool_speed": speed, "dwell": 0.1}
    return plan_trajectory(q, **asked, tool_position=ARM.position, tool_jacobian=ARM.jacobian)


@pytest.mark.long
def test_same_bytes_with_one_thread_or_two_and_in_another_process():
    root = Path(__file__).parents[3]
    found = set()
    for threads in ("1", "2"):
        run = [sys.executable, "-c", SCRIPT]
        done = subprocess.run(run, cwd=root, capture_output=True, text=True, check=True, **with_threads(threads))
        found.add(done.stdout)
    assert len(found) == 1
