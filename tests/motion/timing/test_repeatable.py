import re
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import planner
import planner.motion.timing.phases as timing
from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import plan_trajectory
from tests.motion.timing.arm import nj130
from tests.not_everywhere import ruckig
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


def test_no_file_names_the_web_service_parameter():
    # ruckig's community build sends intermediate positions to a web service
    for path in Path(planner.__file__).parent.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not re.search("intermediate_positions|per_section_max_(velocity|position)", text), path


def test_planning_sets_no_intermediate_positions_and_opens_no_socket(monkeypatch):
    used = []

    class Watched(ruckig.InputParameter):
        def __setattr__(self, name, value):
            assert "intermediate" not in name
            assert "section" not in name
            used.append(name)
            super().__setattr__(name, value)

    def refuse(*_, **__):
        pytest.fail("a socket was opened")

    monkeypatch.setattr(timing.ruckig, "InputParameter", Watched)
    monkeypatch.setattr(socket, "socket", refuse)
    drive()
    assert used
    assert set(used) <= {
        "current_position",
        "current_velocity",
        "current_acceleration",
        "target_position",
        "target_velocity",
        "target_acceleration",
        "max_velocity",
        "max_acceleration",
        "max_jerk",
    }
