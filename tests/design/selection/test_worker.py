"""What is computed beside other work is the same, and ends with its parent."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.common.second_process import ForkedTask, ForkedWorker
from planner.design.selection.index_search import BackgroundCurve, compute_index_curve
from tests.processors import keep_to_one, use_all

SLOW = """
import sys, time, numpy as np
from planner.design.selection.index_search import BackgroundCurve
rows = np.random.default_rng(0).normal(size=(3000, 1, 25))
curve = BackgroundCurve(rows, range(26, 300), "O2", 0)
print(curve.pid, flush=True)
time.sleep(60)
"""


@pytest.fixture(autouse=True)
def _all_processors():
    """On one processor there is no second process."""
    use_all()
    yield
    keep_to_one(os.environ.get("PYTEST_XDIST_WORKER", ""))


@pytest.mark.slow
def test_it_finds_what_one_process_finds():
    rows = np.random.default_rng(0).normal(size=(60, 1, 4))
    with BackgroundCurve(rows, [5, 6, 7], "O2", 0, help_out=True) as curve:
        found = curve.result()
    again = [compute_index_curve(rows, sizes, "O2", 0).values for sizes in ([5, 7], [6])]
    np.testing.assert_array_equal(found.values, [again[0][0], again[1][0], again[0][1]])


def test_errors_come_back():
    def fail():
        raise InputError("no such thing")

    with pytest.raises(InputError, match="no such thing"):
        ForkedTask(fail).result()


class Prover:
    """Something that has an assistant of its own, as the proofs of motions have."""

    def __init__(self):
        self.assistant = ForkedWorker(self.halve)

    def halve(self, number):
        if number % 2:
            raise InputError(f"{number} is odd")
        return number // 2, os.getpid()


def test_an_assistant_answers_in_order_and_tells_errors():
    assistant = Prover().assistant
    for number in (8, 7, 6):
        assistant.begin(number)
    assert assistant.result()[0] == 4
    with pytest.raises(InputError, match="7 is odd"):
        assistant.result()
    half, pid = assistant.result()
    assert half == 3
    assert pid != os.getpid()
    os.kill(pid, signal.SIGKILL)
    assistant.begin(2)
    with pytest.raises(RuntimeError, match="ended from outside"):
        assistant.result()


def test_an_assistant_goes_when_nobody_refers_to_it():
    prover = Prover()
    prover.assistant.begin(2)
    pid = prover.assistant.result()[1]
    del prover
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.slow
def test_the_worker_ends_with_its_parent():
    parent = subprocess.Popen([sys.executable, "-c", SLOW], stdout=subprocess.PIPE, text=True)
    worker = int(parent.stdout.readline())
    time.sleep(1.0)
    os.kill(worker, 0)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    until = time.monotonic() + 120.0
    while time.monotonic() < until:
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.2)
    raise AssertionError("the worker lives on")
