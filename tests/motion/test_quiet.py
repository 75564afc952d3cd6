"""Standard output belongs to results: what a solver prints on its own does not come there."""

import os
import subprocess
import sys
from threading import Thread

import pytest

from planner.common.quiet import quiet_output

TOUR = """
import numpy as np
from planner.motion.tour.exact import Relaxation
from planner.motion.tour.instance import TourInstance
{before}
xy = np.random.default_rng(0).uniform(0, 100, (12, 2))
cost = np.rint(np.hypot(*(xy[:, None] - xy[None]).T)).astype(np.int64)
instance = TourInstance(cost, 1.0, np.zeros_like(cost, dtype=bool))
print("begin")
Relaxation(instance, 10**4, np.array([[k, (k + 1) % 12] for k in range(12)])).optimize()
print("end")
"""


@pytest.mark.slow
@pytest.mark.parametrize("before", ["", "import os; os.close(2)"], ids=["plain", "without standard error"])
def test_a_tour_prints_nothing_in_python(before):
    done = subprocess.run(
        [sys.executable, "-c", TOUR.format(before=before)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "begin\nend\n"


def test_only_what_is_written_inside_is_dropped(capfd):
    os.write(1, b"before ")
    with quiet_output():
        os.write(1, b"inside ")
        os.write(2, b"told")
    os.write(1, b"after")
    assert capfd.readouterr() == ("before after", "told")


def test_it_ends_with_an_error_too(capfd):
    with pytest.raises(ValueError), quiet_output():
        raise ValueError
    os.write(1, b"after")
    assert capfd.readouterr().out == "after"


def test_threads_leave_the_descriptor_as_it_was(capfd):
    before = os.fstat(1)
    open_before = len(os.listdir("/proc/self/fd"))

    def work():
        for _ in range(200):
            with quiet_output():
                os.write(1, b"banner")

    threads = [Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert os.path.samestat(os.fstat(1), before)
    assert len(os.listdir("/proc/self/fd")) == open_before
    assert capfd.readouterr().out == ""
